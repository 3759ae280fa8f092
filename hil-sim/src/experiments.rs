//! The experiments. Each is one function from a [`Context`] to an [`Outcome`].
#![deny(clippy::use_debug)]

mod anti_windup;
pub mod battery;
pub mod commission;
mod current_step;
pub mod drawn_machine;
mod foreign_motors;
pub mod full_range;
mod lock_monitor;
mod losses;
mod machines;
mod monte_carlo;
mod orientation;
mod record;
pub mod scenario;
mod sensorless_position;
mod shaft;
mod smallest_slope;
mod torque_envelope;
pub mod torque_limit;
mod torque_rise;

pub use sim_bench::experiment::*;
use sim_bench::steady;
pub use sim_bench::{learning, statistics};
pub use sim_lab::*;
use statistics::Statistical;

use crate::prelude::*;

/// All experiments, in the order of the report.
#[rustfmt::skip] // one a line: the list grows
pub const EXPERIMENTS: &[Experiment] = &[
    recomputed::EXPERIMENT,
    modulation::EXPERIMENT,
    filters::EXPERIMENT,
    adc_calibration::EXPERIMENT,
    pi_design::EXPERIMENT,
    plant_identification::EXPERIMENT,
    current_step::EXPERIMENT,
    anti_windup::EXPERIMENT,
    dead_time::EXPERIMENT,
    orientation::EXPERIMENT,
    injection_map::EXPERIMENT,
    saliency::EXPERIMENT,
    demodulators::EXPERIMENT,
    angle_identification::EXPERIMENT,
    learn_reference::EXPERIMENT,
    as_printed::EXPERIMENT,
    scenario::POSITION,
    sensorless_position::EXPERIMENT,
    scenario::STEPS,
    scenario::RAMP,
    scenario::REVERSAL,
    perturbation::EXPERIMENT,
    scenario::SPEED,
    monte_carlo::EXPERIMENT,
    machines::EXPERIMENT,
    commission::EXPERIMENT,
    commission::refusals::EXPERIMENT,
    battery::EXPERIMENT,
    full_range::EXPERIMENT,
    torque_envelope::EXPERIMENT,
    losses::EXPERIMENT,
    lock_monitor::EXPERIMENT,
    record::EXPERIMENT,
    torque_rise::EXPERIMENT,
    shaft::EXPERIMENT,
    smallest_slope::EXPERIMENT,
    foreign_motors::EXPERIMENT,
    identify_discrete::EXPERIMENT,
    identify_continuous::EXPERIMENT,
    identify_recursive::EXPERIMENT,
    identify_validate::EXPERIMENT,
    identify_machine::EXPERIMENT,
    motor_tests::EXPERIMENT,
    online_tracking::EXPERIMENT,
    measured_motors::EXPERIMENT,
];

/// The experiments that report printed values of the sources.
#[rustfmt::skip] // names, side by side
pub const SOURCES: [&str; 20] = [
    "printed-numbers", "modulation", "filters", "adc-calibration", "pi-design", "plant-identification",
    "current-step", "anti-windup", "dead-time", "injection-map", "demodulators", "angle-identification", "as-printed",
    "sensorless-position", "identify-discrete", "identify-continuous", "identify-recursive", "identify-validate",
    "identify-machine", "motor-tests",
];

/// The experiments that need an input file; they are not part of the report.
pub const WITH_INPUT: &[Experiment] = &[scenario::PROFILE, measured_start::EXPERIMENT];

/// The experiments that a user of a drive needs, in the order of `list`; `list --lab` shows the others.
#[rustfmt::skip] // names, side by side
pub const EVERYDAY: [&str; 10] = [
    "torque-steps", "speed-profile", "sensorless-position", "profile", "commission", "monte-carlo", "battery",
    "full-range", "torque-envelope", "lock-monitor",
];

/// Returns the single runs of an experiment.
///
/// # Errors
/// [`Error::Refused`] if it does not consist of independent runs.
pub fn statistical(experiment: &Experiment) -> Result<&Statistical, Error> {
    experiment.study.as_ref().ok_or_else(|| {
        let known = EXPERIMENTS.iter().filter(|known| known.study.is_some());
        let known: Vec<_> = known.map(|known| known.name).collect();
        let (name, known) = (cut(experiment.name), known.join(", "));
        Error::Refused(format!(
            "{name} does not consist of independent runs; those that do: {known}"
        ))
    })
}

/// Removed experiments, and their replacements.
const REPLACED: &[(&str, &str)] = &[
    ("tracking", "`run record`, `run torque-steps` and `run perturbation`"),
    ("torque-drift", "`run record --set record.minutes=1`"),
    ("speed-torque-sweep", "`run full-range --set full_range.kind=constant`"),
    ("saliency-check", "`run smallest-slope`"),
];
/// Checks that a file is given to an experiment that needs one, and to no other.
///
/// # Errors
/// [`Error::Refused`].
pub fn check_file(experiment: &Experiment, file: Option<&Path>) -> Result<(), Error> {
    let (name, with) = (experiment.name, WITH_INPUT.iter().map(|with| with.name));
    match (with.clone().any(|with| with == name), file) {
        (true, None) => Err(Error::Refused(format!("{name} needs --input FILE"))),
        (false, Some(file)) => {
            let (file, with) = (file.display(), with.collect::<Vec<_>>().join(", "));
            let why = format!("{name} takes no file; allowed with: {with}");
            Err(Error::Refused(format!("--input {file}: {why}")))
        }
        _ => Ok(()),
    }
}

/// The experiment that runs without a command.
pub const DEFAULT: &str = "torque-steps";

/// Returns the experiments for a name on the command line: one, or a group of all whose names begin with it and a
/// hyphen, as `identify`. An unknown name is returned unchanged.
pub fn named(name: &str) -> Vec<&str> {
    let known = || EXPERIMENTS.iter().map(|experiment| experiment.name);
    let begins = format!("{name}-");
    let group: Vec<&str> = known().filter(|known| known.starts_with(&begins)).collect();
    if group.len() < 2 || known().any(|known| known == name) { vec![name] } else { group }
}

/// Returns the experiment with this name.
///
/// # Errors
/// [`Error::Unknown`] with the most similar name; [`Error::Refused`] with the replacement of a removed experiment.
pub fn find(name: &str) -> Result<&'static Experiment, Error> {
    let all = || EXPERIMENTS.iter().chain(WITH_INPUT);
    let found = all().find(|experiment| experiment.name == name);
    found.ok_or_else(|| match REPLACED.iter().find(|(old, _)| *old == name) {
        Some((_, by)) => Error::Refused(format!("the experiment `{name}` is gone; use {by}")),
        None => Error::unknown("experiment", name, all().map(|experiment| experiment.name)),
    })
}

/// Runs the experiment with this name for its own time, without progress bars.
///
/// # Errors
/// As [`find`], and the errors of the experiment.
pub fn run(name: &str, config: &Config, seed: u64) -> Result<Outcome, Error> {
    find(name)?.outcome(config, seed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the page "Adding an experiment".
    mod amplitude;

    #[test]
    fn the_example_of_the_book_runs_as_it_is_printed() {
        let page = include_str!("../../docs/add-an-experiment.md");
        let example = include_str!("experiments/tests/amplitude.rs");
        assert!(
            page.contains(&format!("```rust\n{example}```")),
            "amplitude.rs differs from the page"
        );
        let outcome = amplitude::EXPERIMENT.outcome(&Config::default(), 1).unwrap();
        let rms = |volts: u32| outcome.metrics.get(&format!("rms_at_{volts}_v_deg")).unwrap();
        assert!((0.1..5.0).contains(&rms(80)) && rms(80) < rms(40), "more injection, less noise");
    }

    #[test]
    fn a_group_is_all_that_begin_alike() {
        assert!(named("identify").len() == 5 && named("identify").contains(&"identify-validate"));
        assert_eq!(named("motor-tests"), ["motor-tests"]);
        assert_eq!(named("nonsense"), ["nonsense"]);
    }

    #[test]
    fn names_are_unique_and_found() {
        assert!(find(DEFAULT).is_ok());
        for experiment in EXPERIMENTS {
            assert_eq!(find(experiment.name).map(|found| found.about).ok(), Some(experiment.about));
        }
    }
}
