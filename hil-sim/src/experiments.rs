//! The experiments. Each is one function from a [`Context`] to an [`Outcome`].
#![deny(clippy::use_debug)]

mod anti_windup;
pub mod battery;
pub mod commission;
pub mod course;
mod current_step;
mod disturbed;
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
mod torque_envelope;
pub mod torque_limit;
mod torque_rise;

use std::sync::LazyLock;

pub use sim_bench::experiment::*;
use sim_bench::steady;
pub use sim_bench::{learning, statistics};
pub use sim_lab::*;
use statistics::Statistical;

use crate::prelude::*;

/// All experiments, in the order of the report.
#[rustfmt::skip] // one a line: the list grows
pub static EXPERIMENTS: LazyLock<Vec<Experiment>> = LazyLock::new(|| Vec::from([
    Experiment::new("printed-numbers", recomputed::run),
    Experiment::new("modulation", modulation::run),
    Experiment::new("filters", filters::run),
    Experiment::new("adc-calibration", adc_calibration::run),
    Experiment::new("pi-design", pi_design::run),
    Experiment::new("plant-identification", plant_identification::run),
    Experiment::new("current-step", current_step::run),
    Experiment::new("anti-windup", anti_windup::run),
    Experiment::new("dead-time", dead_time::run),
    Experiment::new("encoder-orientation", orientation::run),
    Experiment::new("injection-map", injection_map::run),
    Experiment::new("saliency", saliency::run),
    Experiment::new("demodulators", demodulators::run),
    Experiment::new("angle-identification", angle_identification::run),
    Experiment::new("learn-reference", learn_reference::run),
    Experiment::new("as-printed", as_printed::run),
    Experiment::new("position-step", |context| scenario::shipped("position-step", context)),
    Experiment::new("sensorless-position", sensorless_position::run),
    Experiment::new("torque-steps", |context| scenario::shipped("torque-steps", context)),
    Experiment::new("injection-ripple", |context| scenario::shipped("injection-ripple", context)),
    Experiment::new("torque-ramp", |context| scenario::shipped("torque-ramp", context)),
    Experiment::new("torque-reversal", |context| scenario::shipped("torque-reversal", context)),
    Experiment::new("perturbation", perturbation::run),
    Experiment::new("speed-profile", |context| scenario::shipped("speed-profile", context)),
    Experiment::study::<monte_carlo::MonteCarlo>(),
    Experiment::study::<machines::Machines>(),
    Experiment::study::<commission::Commission>(),
    Experiment::study::<commission::refusals::Refusals>(),
    Experiment::study::<battery::Battery>(),
    Experiment::study::<full_range::FullRange>(),
    Experiment::new("torque-envelope", torque_envelope::run),
    Experiment::new("losses", losses::run),
    Experiment::study::<lock_monitor::LockMonitor>(),
    Experiment::new("record", record::run),
    Experiment::new("torque-rise", torque_rise::run),
    Experiment::new("shaft", shaft::run),
    Experiment::study::<foreign_motors::ForeignMotors>(),
    Experiment::new("identify-discrete", identify_discrete::run),
    Experiment::new("identify-continuous", identify_continuous::run),
    Experiment::new("identify-recursive", identify_recursive::run),
    Experiment::new("identify-validate", identify_validate::run),
    Experiment::new("identify-machine", identify_machine::run),
    Experiment::new("motor-tests", motor_tests::run),
    Experiment::new("online-tracking", online_tracking::run),
    Experiment::new("measured-motors", measured_motors::run),
].map(described)));

/// The experiments that report printed values of the sources.
pub static SOURCES: LazyLock<&[String]> = LazyLock::new(|| &FILE.sources);

/// The experiments that need an input file; they are not part of the report.
pub static WITH_INPUT: LazyLock<[Experiment; 2]> = LazyLock::new(|| {
    let profile = Experiment::new("profile", scenario::profile);
    [profile, Experiment::new("measured-start", measured_start::run)].map(described)
});

/// The identification from a recorded trace. It is a command of its own, for its options, and not in the lists.
pub static TRACE: LazyLock<Experiment> = LazyLock::new(|| {
    described(Experiment::new("identify-trace", |_| {
        Err(Error::Refused("identify-trace is a command of its own".into()))
    }))
});

/// The experiments that a user of a drive needs, in the order of `list`; `list --lab` shows the others.
pub static EVERYDAY: LazyLock<&[String]> = LazyLock::new(|| &FILE.everyday);

/// The file `experiments.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// See [`EVERYDAY`] and [`SOURCES`].
    everyday: Vec<String>,
    sources: Vec<String>,
    /// Removed experiments, and their replacements.
    replaced: BTreeMap<String, String>,
    /// Keys of a group by its name.
    groups: BTreeMap<String, Vec<String>>,
    experiment: BTreeMap<String, Description>,
}

/// An experiment in the file; see the fields of [`Experiment`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    #[serde(default)]
    stands_for: String,
    about: String,
    #[serde(default)]
    uses: Vec<String>,
    #[serde(default)]
    not: Vec<String>,
    #[serde(default)]
    remarks: Vec<String>,
}

static FILE: LazyLock<File> = LazyLock::new(|| {
    let file = toml::from_str(include_str!("experiments.toml"));
    file.expect("experiments.toml is part of the program")
});

/// Adds the description of an experiment in `experiments.toml`.
fn described(experiment: Experiment) -> Experiment {
    let keys = |names: &'static [String]| {
        let own = std::slice::from_ref;
        let of = |name: &'static String| FILE.groups.get(name).map_or(own(name), Vec::as_slice);
        names.iter().flat_map(of).map(String::as_str).collect()
    };
    let Description { stands_for, about, uses, not, remarks } = &FILE.experiment[experiment.name];
    Experiment { stands_for, about, uses: keys(uses), not: keys(not), remarks, ..experiment }
}

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
    let all = || EXPERIMENTS.iter().chain(&*WITH_INPUT);
    let found = all().find(|experiment| experiment.name == name);
    found.ok_or_else(|| match FILE.replaced.get(name) {
        Some(by) => Error::Refused(format!("the experiment `{name}` is gone; use {by}")),
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
        let page = include_str!("../../docs/developing.md");
        let example = include_str!("experiments/tests/amplitude.rs");
        assert!(
            page.contains(&format!("```rust\n{example}```")),
            "amplitude.rs differs from the page"
        );
        let outcome =
            Experiment::new("amplitude", amplitude::run).outcome(&Config::default(), 1).unwrap();
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
    fn names_are_unique_and_found_and_each_description_is_used() {
        assert!(find(DEFAULT).is_ok());
        for experiment in EXPERIMENTS.iter() {
            assert_eq!(find(experiment.name).map(|found| found.about).ok(), Some(experiment.about));
            for name in experiment.uses.iter().chain(&experiment.not) {
                let is_meant = |key: Key| key.assigned_name().starts_with(name);
                let is_key = Key::all().chain(Key::after()).any(is_meant);
                assert!(is_key, "{}: {name}", experiment.name);
            }
        }
        // Besides those in the lists: a scenario of the user, and the command `identify-trace`.
        assert_eq!(FILE.experiment.len(), EXPERIMENTS.len() + WITH_INPUT.len() + 2);
    }
}
