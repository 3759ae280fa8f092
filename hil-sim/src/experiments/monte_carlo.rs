//! Statistics of the angle error over random operating points.

use super::steady::{OperatingPoint, SteadyRun, steady_run};
use crate::prelude::*;

const RUNS: u32 = 200;
/// Number of worst runs in the list.
const WORST: usize = 10;
/// q-axis currents on the dissertation's motor, A.
const IQ_A: (f64, f64) = (0.5, 3.0);
/// Largest speed on four poles, rpm, unless `load.speed_rpm` sets another.
const SPEED_RPM: f64 = 150.0;

/// The runs.
pub struct MonteCarlo {
    config: Config,
    seed: u64,
    seconds: f64,
    /// Largest speed, rpm.
    bound: f64,
}

impl Study for MonteCarlo {
    type Record = SteadyRun;
    const NAME: &'static str = "monte-carlo";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let config = context.config.clone();
        let bound = config.load.speed_rpm.abs();
        let bound = if bound > 0.0 { bound } else { config.rpm(SPEED_RPM) };
        let (runs, seconds) = (config.extent.runs.unwrap_or(RUNS), context.seconds.unwrap_or(2.0));
        Ok((Self { config, seed: context.seed, seconds, bound }, runs as usize))
    }

    fn run(&self, number: usize) -> Result<SteadyRun, Error> {
        // Every run has its own random generator, so that each can be repeated alone by its seed.
        let seed = seed_of(self.seed, number);
        let mut random = seeded(seed);
        let (least, most) = (self.config.amperes(IQ_A.0), self.config.amperes(IQ_A.1));
        let iq = sign(&mut random) * random.random_range(least..=most);
        let case = OperatingPoint { rpm: random.random_range(-self.bound..=self.bound), iq, seed };
        steady_run(&spread(&self.config, &mut random), case, self.seconds)
    }

    fn outcome(&self, _: &Context<'_>, runs: Vec<SteadyRun>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        outcome.faults.extend(runs.iter().filter_map(SteadyRun::lost_text));
        let kept: Vec<&SteadyRun> = runs.iter().filter(|run| !run.lost).collect();
        let largest = sorted(kept.iter().map(|run| run.error.largest()));
        let squares = kept.iter().map(|run| run.error.rms().powi(2)).sum::<f64>();
        let m = &mut outcome.metrics;
        m.set("angle_error_rms_deg", (squares / kept.len() as f64).sqrt());
        m.set("worst_run_rms_deg", kept.iter().map(|run| run.error.rms()).fold(0.0, f64::max));
        m.set("angle_error_max_deg", quantile(&largest, 1.0));
        m.set("run_max_p99_deg", quantile(&largest, 0.99));
        m.set("lost_runs", (runs.len() - kept.len()) as f64);
        m.set("runs", runs.len() as f64);

        let columns = columns![|_, run: &SteadyRun|
            "seed" => Cell::from(run.case.seed.to_string());
            "iq (A)" => Cell::fixed(run.case.iq, 3);
            "speed (rpm)" => Cell::fixed(run.case.rpm, 1);
            "rms (°)" => Cell::fixed(run.error.rms(), 2);
            "mean (°)" => Cell::fixed(run.error.mean(), 2);
            "largest (°)" => Cell::fixed(run.error.largest(), 2);
        ];
        if kept.len() < runs.len() {
            let lost = runs.iter().filter(|run| run.lost).enumerate();
            outcome.tables.push(Table::of("Lost runs", &columns[..3], lost));
        }
        let mut by_rms = kept.clone();
        by_rms.sort_by(|a, b| b.error.rms().total_cmp(&a.error.rms()));
        let worst = by_rms.into_iter().take(WORST).enumerate();
        outcome.tables.push(Table::of("Worst runs", &columns, worst));
        let points = |of: fn(&SteadyRun) -> f64| kept.iter().map(|r| (r.case.iq, of(r))).collect();
        let panel = Panel::new("quadrature current (A)", "angle error (°)")
            .with(Series::points("largest", points(|r| r.error.largest())))
            .with(Series::points("rms", points(|r| r.error.rms())))
            .with(Series::points("mean", points(|r| r.error.mean())));
        outcome.figures.push(texts::figure("monte-carlo", "runs").panel(panel));
        outcome.remarks = assumptions(&self.config);
        texts::add_remarks(&mut outcome, "monte-carlo", &[("speed_rpm", self.bound)]);
        Ok(outcome)
    }
}

/// Returns the configuration with random errors of the sizes in `spread`.
fn spread(config: &Config, random: &mut impl Rng) -> Config {
    let mut drawn = config.clone();
    let mut factor = |largest: f64| 1.0 + random.random_range(-largest..=largest);
    let (spread, motor) = (&config.spread, &mut drawn.drive.motor);
    for place in [&mut motor.r_s, &mut motor.r_r, &mut motor.l_ls, &mut motor.l_lr, &mut motor.l_m]
    {
        *place = (f64::from(*place) * factor(spread.motor)) as f32;
    }
    let noise_a = plant_settings(config).measurement.noise_a;
    drawn.measurement.noise_a = Some(noise_a * factor(spread.noise));
    drawn.measurement.gain_error_a += factor(spread.gain) - 1.0;
    drawn.measurement.gain_error_b += factor(spread.gain) - 1.0;
    drawn
}
