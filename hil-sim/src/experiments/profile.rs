//! A profile of the user: references and load over time from a CSV file.

use std::f64::consts::TAU;
use std::path::Path;

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Accepted, Command, Mode};

use super::torque::{LOST_DEG, assumptions};
use super::{BENCH, Context, DRIVE, Experiment};
use crate::columns::Columns;
use crate::config::LoadMode;
use crate::error::Error;
use crate::outcome::{Figure, Outcome, Panel, Series};
use crate::plant::Load;
use crate::rig::{Point, RATE_HZ, Rig, means_over};
use crate::stats::Stats;

/// Not a figure of the source.
pub const EXPERIMENT: Experiment = Experiment {
    name: "profile",
    stands_for: "a profile of the user",
    about: "References and load over time from a CSV file: `run profile --input FILE.csv`.",
    uses: &[BENCH, DRIVE, &["load.", "prepare.learn", "seconds"]],
    not: &[],
    run,
};

/// A quantity that the profile can prescribe.
struct Reference {
    column: &'static str,
    mode: Mode,
    label: &'static str,
    command: fn(f32) -> Command,
    actual: fn(&Point) -> f64,
    error: &'static str,
}

/// The three of which a profile has one.
const REFERENCES: [Reference; 3] = [
    Reference {
        column: "torque_current_a",
        mode: Mode::Torque,
        label: "quadrature current (A)",
        command: Command::Torque,
        actual: |p| p.iq,
        error: "torque_current_error_rms_a",
    },
    Reference {
        column: "speed_rpm",
        mode: Mode::Speed,
        label: "speed (rpm)",
        command: Command::Speed,
        actual: |p| p.speed_rpm,
        error: "speed_error_rms_rpm",
    },
    Reference {
        column: "position_turns",
        mode: Mode::Position,
        label: "position (turns)",
        command: Command::Position,
        actual: |p| p.turns,
        error: "position_error_rms_turns",
    },
];
const TIME: &str = "time_s";
const LOADS: [&str; 2] = ["load_nm", "load_rpm"];

/// A profile: straight lines between its rows; two rows of the same time are a step.
struct Profile {
    time: Vec<f64>,
    reference: &'static Reference,
    values: Vec<f64>,
    load_nm: Option<Vec<f64>>,
    load_rpm: Option<Vec<f64>>,
}

impl Profile {
    fn read(path: &Path) -> Result<Self, Error> {
        let columns = Columns::read(path)?;
        let names = REFERENCES.map(|reference| reference.column);
        columns.only(&[&[TIME], &names[..], &LOADS].concat())?;
        let time = columns.need(TIME)?;
        let given: Vec<_> = REFERENCES
            .iter()
            .filter_map(|reference| Some((reference, columns.get(reference.column)?)))
            .collect();
        let Ok([(reference, values)]) = <[_; 1]>::try_from(given) else {
            let names = names.join(", ");
            return Err(
                columns.error(format!("one of the columns {names} must be there, and only one"))
            );
        };
        let [load_nm, load_rpm] = LOADS.map(|name| columns.get(name));
        if load_nm.is_some() && load_rpm.is_some() {
            return Err(columns.error("load_nm and load_rpm exclude each other: a shaft turns freely against a torque, or its speed is held".into()));
        }
        if columns.len() < 2 {
            return Err(columns.error(format!("{} rows; a profile has two or more", columns.len())));
        }
        if time[0] != 0.0 {
            return Err(columns.at(1, format!("time_s = {}; the first row is at 0", time[0])));
        }
        if let Some(row) = (1..time.len()).find(|&row| time[row] < time[row - 1]) {
            let (this, before) = (time[row], time[row - 1]);
            return Err(columns
                .at(row + 1, format!("time_s = {this} after {before}: it must not decrease")));
        }
        if time[time.len() - 1] <= 0.0 {
            return Err(columns.error("all rows are at the time 0".into()));
        }
        Ok(Self { time, reference, values, load_nm, load_rpm })
    }

    /// Value of a column at a time; the last row holds afterwards.
    fn at(&self, column: &[f64], t: f64) -> f64 {
        // The last row at or before `t`, so that a step has its second value at its time.
        let after = self.time.partition_point(|&known| known <= t);
        let Some(&next) = column.get(after) else { return column[column.len() - 1] };
        let before = after - 1;
        let share = (t - self.time[before]) / (self.time[after] - self.time[before]);
        column[before] + share * (next - column[before])
    }

    fn load(&self, t: f64) -> Option<Load> {
        let torque = self.load_nm.as_ref().map(|nm| Load::Free { torque: self.at(nm, t) });
        let speed = |rpm: &Vec<f64>| Load::Speed { speed: self.at(rpm, t) * TAU / 60.0 };
        torque.or_else(|| self.load_rpm.as_ref().map(speed))
    }

    fn end(&self) -> f64 {
        self.time[self.time.len() - 1]
    }
}

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    super::check_file(&EXPERIMENT, context.file)?;
    let profile = Profile::read(context.file.unwrap_or(Path::new("")))?;
    let reference = profile.reference;
    let mut config = context.config.clone();
    if reference.mode != Mode::Torque && config.load.mode == LoadMode::Locked {
        config.load.mode = LoadMode::Free;
    }
    let mut rig = Rig::from_config(&config, context.seed)?;
    rig.start(reference.mode)?;
    let (start, origin) = (rig.time(), rig.plant.mechanical_angle() / TAU);
    let block_s = CARRIER_SAMPLES as f64 / RATE_HZ;
    let seconds = context.seconds.unwrap_or(profile.end());
    let blocks = (seconds / block_s).ceil() as u64;
    let bar = context.progress.bar("profile", blocks);
    let (mut points, mut wanted, mut limited) = (Vec::new(), Vec::new(), None);
    for block in 0..blocks {
        if rig.fault().is_some() {
            break;
        }
        let t = block as f64 * block_s;
        let value = profile.at(&profile.values, t);
        if let Accepted::Limited(to) = rig.command(&(reference.command)(value as f32))? {
            limited.get_or_insert((t, value, to));
        }
        if let Some(load) = profile.load(t) {
            rig.set_load(load)?;
        }
        wanted.push((t, value));
        rig.run(block_s, |p| {
            points.push(Point { t: p.t - start, turns: p.turns - origin, ..*p });
        });
        bar.advance(1);
    }
    let mut outcome = outcome(&rig, reference, &points, wanted);
    if let Some((t, value, to)) = limited {
        outcome.remarks.push(format!(
            "The drive limited {} of {value} to {to}, for the first time at {t:.3} s.",
            reference.column
        ));
    }
    outcome.remarks.extend(assumptions(&config));
    Ok(outcome)
}

fn outcome(rig: &Rig, reference: &Reference, points: &[Point], wanted: Vec<(f64, f64)>) -> Outcome {
    let mut outcome = Outcome::default();
    let angle = Stats::of(points.iter().map(|p| p.angle_error_deg));
    let differences = points
        .chunks(CARRIER_SAMPLES)
        .zip(&wanted)
        .flat_map(|(block, (_, value))| block.iter().map(move |p| (reference.actual)(p) - value));
    let m = &mut outcome.metrics;
    m.set(reference.error, Stats::of(differences).rms());
    m.set("angle_error_rms_deg", angle.rms());
    m.set("angle_error_max_deg", angle.largest());
    m.set("torque_max_nm", points.iter().map(|p| p.torque.abs()).fold(0.0, f64::max));
    outcome.faults.extend(rig.fault());
    let lost = rig.fault().is_some() || angle.largest() > LOST_DEG;
    m.set("lost", f64::from(u8::from(lost)));
    let line = |of: fn(&Point) -> f64| means_over(CARRIER_SAMPLES, points, of);
    let x = "time (s)";
    let mut first =
        Panel::new(x, reference.label).with(Series::line("actual", line(reference.actual)));
    first = first.with(Series::reference("profile", wanted));
    let mut figure = Figure::new("profile", "Profile of the user", "").panel(first);
    type Quantity = (&'static str, fn(&Point) -> f64);
    let others: [Quantity; 4] = [
        ("quadrature current (A)", |p| p.iq),
        ("torque (Nm)", |p| p.torque),
        ("speed (rpm)", |p| p.speed_rpm),
        ("angle error (° electrical)", |p| p.angle_error_deg),
    ];
    for (label, of) in others.into_iter().filter(|(label, _)| *label != reference.label) {
        figure = figure.panel(Panel::new(x, label).with(Series::line("", line(of))));
    }
    let end = points.last().map_or(0.0, |p| p.t);
    figure = figure.events(rig.fault().map(|fault| (end, fault)));
    outcome.figures.push(figure);
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_is_linear_between_rows_and_steps_where_two_have_one_time() {
        let profile = Profile {
            time: vec![0.0, 1.0, 1.0, 3.0],
            reference: &REFERENCES[0],
            values: vec![0.0, 2.0, -1.0, 1.0],
            load_nm: None,
            load_rpm: None,
        };
        for (t, value) in [(0.0, 0.0), (0.5, 1.0), (1.0, -1.0), (2.0, 0.0), (3.0, 1.0), (9.0, 1.0)]
        {
            assert_eq!(profile.at(&profile.values, t), value, "{t} s");
        }
    }
}
