//! The angle error over torque current and speed.

use super::statistics::{Study, whole};
use super::steady::{OperatingPoint, SteadyRun, steady_run};
use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment, FREE_SHAFT, SPEED_LOOP};
use crate::config::Config;
use crate::error::Error;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};

/// Not a figure of the source: it shows how far its statement "about 50°" goes.
pub const EXPERIMENT: Experiment = Experiment {
    name: "speed-torque-sweep",
    stands_for: "the range behind Figures 38 and 39",
    about: "Angle error over torque current and speed, a dynamometer holding the speed.",
    uses: &[BENCH, DRIVE, &["prepare.learn", "seconds"]],
    not: &[FREE_SHAFT, SPEED_LOOP],
    run: whole::<Sweep>,
};

/// Torque currents on the dissertation's motor, A.
const IQ_A: [f64; 7] = [0.5, 1.0, 1.5, 2.0, 3.0, -1.0, -2.0];
/// Speeds on four poles, rpm.
const SPEEDS_RPM: [f64; 7] = [0.0, 30.0, -30.0, 150.0, -150.0, 300.0, 600.0];

/// The runs: every current at every speed.
pub struct Sweep {
    config: Config,
    seed: u64,
    seconds: f64,
    currents: [f64; IQ_A.len()],
    speeds: [f64; SPEEDS_RPM.len()],
}

impl Study for Sweep {
    type Record = SteadyRun;
    const EXPERIMENT: &'static Experiment = &EXPERIMENT;

    fn new(context: &Context<'_>) -> Result<Self, Error> {
        let config = context.config.clone();
        let currents = IQ_A.map(|iq| config.amperes(iq));
        let speeds = SPEEDS_RPM.map(|rpm| config.rpm(rpm));
        let seconds = context.seconds.unwrap_or(2.0);
        Ok(Self { config, seed: context.seed, seconds, currents, speeds })
    }

    fn runs(&self) -> usize {
        self.speeds.len() * self.currents.len()
    }

    fn run(&self, number: usize) -> Result<SteadyRun, Error> {
        let rpm = self.speeds[number / self.currents.len()];
        let iq = self.currents[number % self.currents.len()];
        let case = OperatingPoint { rpm, iq, seed: self.seed.wrapping_add(number as u64) };
        steady_run(&self.config, case, self.seconds)
    }

    fn outcome(&self, _: &Context<'_>, runs: Vec<SteadyRun>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        outcome.faults.extend(runs.iter().filter_map(SteadyRun::lost_text));
        let kept = || runs.iter().filter(|r| !r.lost);
        let largest = |of: fn(&SteadyRun) -> f64| kept().map(of).fold(0.0, f64::max);
        let pooled =
            (kept().map(|r| r.error.rms().powi(2)).sum::<f64>() / kept().count() as f64).sqrt();
        let m = &mut outcome.metrics;
        m.set("angle_error_rms_deg", pooled);
        m.set("worst_run_rms_deg", largest(|r| r.error.rms()));
        m.set("angle_error_max_deg", largest(|r| r.error.largest()));
        m.set("runs", runs.len() as f64);
        m.set("lost_runs", runs.iter().filter(|r| r.lost).count() as f64);

        let mut table = Table::new("Angle error, mean ± rms about it (°)", &[]).note(
            "Two seconds each, one second after the speed is reached. lost: beyond 45°, or stopped.",
        );
        for (rpm, row) in self.speeds.iter().zip(runs.chunks(IQ_A.len())) {
            let cell = |r: &SteadyRun| {
                if r.lost {
                    Cell::from("lost")
                } else {
                    Cell::from(format!("{:.1} ± {:.1}", r.error.mean(), r.error.deviation()))
                }
            };
            let cells =
                self.currents.iter().zip(row).map(|(iq, run)| (format!("iq = {iq} A"), cell(run)));
            table.record(
                [("speed (rpm)".to_owned(), Cell::fixed(*rpm, 0))].into_iter().chain(cells),
            );
        }
        outcome.tables.push(table);

        let mut error = Panel::new("quadrature current (A)", "mean angle error (°)");
        let mut torque = Panel::new("quadrature current (A)", "mean torque (Nm)");
        for (rpm, row) in self.speeds.iter().zip(runs.chunks(IQ_A.len())) {
            let line = |of: fn(&SteadyRun) -> f64| {
                let mut points: Vec<_> = self
                    .currents
                    .iter()
                    .zip(row)
                    .filter(|(_, r)| !r.lost)
                    .map(|(&iq, r)| (iq, of(r)))
                    .collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                points
            };
            error = error.with(Series::line(format!("{rpm} rpm"), line(|r| r.error.mean())));
            torque = torque.with(Series::line(format!("{rpm} rpm"), line(|r| r.torque)));
        }
        let title = "Angle error and torque over current and speed";
        outcome.figures.push(Figure::new("sweep", title, "").panel(error).panel(torque));
        outcome.remarks = assumptions(&self.config);
        Ok(outcome)
    }
}
