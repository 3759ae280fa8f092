//! The experiments. Each is one function from a [`Context`] to an [`Outcome`].
#![deny(clippy::use_debug)]

mod adc_calibration;
mod angle_identification;
mod anti_windup;
pub mod battery;
mod bode;
pub mod commission;
mod current_step;
mod dead_time;
mod demodulators;
mod filters;
pub mod full_range;
mod identify_continuous;
mod identify_discrete;
mod identify_machine;
mod identify_recursive;
pub mod identify_trace;
mod identify_validate;
mod injection_map;
mod learn_reference;
pub mod learning;
mod linear_model;
mod lock_monitor;
mod losses;
mod machines;
pub mod measured_motors;
mod modulation;
mod monte_carlo;
mod motor_tests;
mod online_tracking;
mod orientation;
mod perturbation;
mod pi_design;
mod plant_identification;
mod record;
pub mod saliency;
pub mod scenario;
mod sensorless_position;
mod smallest_slope;
pub mod statistics;
mod steady;
pub mod torque;
mod torque_envelope;
pub mod torque_limit;
mod torque_rise;
pub mod warming_rotor;

pub use torque::assumptions;

use statistics::Statistical;

use std::path::Path;

use rayon::prelude::*;

use crate::config::{Config, Key};
use crate::error::Error;
use crate::outcome::Outcome;
use crate::progress::Progress;

/// Input of an experiment.
pub struct Context<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// Seed of all that is random.
    pub seed: u64,
    /// Simulated time, s; unset: the experiment's own.
    pub seconds: Option<f64>,
    /// Progress bars.
    pub progress: Progress,
    /// File of an experiment that takes one.
    pub file: Option<&'a Path>,
}

impl Context<'_> {
    /// Runs `run` with the number and the value of every job on all cores, with a progress bar.
    ///
    /// # Errors
    /// The error of a job that failed.
    pub fn in_parallel<J: Sync, T: Send>(
        &self,
        label: &str,
        jobs: &[J],
        run: impl Fn(u64, &J) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        let bar = self.progress.bar(label, jobs.len() as u64);
        let one = |(number, job): (usize, &J)| {
            let result = run(number as u64, job);
            bar.advance(1);
            result
        };
        jobs.par_iter().enumerate().map(one).collect()
    }
}

/// An experiment.
pub struct Experiment {
    /// Name on the command line.
    pub name: &'static str,
    /// The part of the source that it reproduces: `Figure 38`.
    pub stands_for: &'static str,
    /// Description in one sentence.
    pub about: &'static str,
    /// The keys that it uses: names, and beginnings of names that end in a full stop.
    pub uses: &'static [&'static [&'static str]],
    /// Exceptions from `uses`, likewise: keys that the experiment sets itself, or that do nothing in it.
    pub not: &'static [&'static [&'static str]],
    /// Runs it.
    pub run: fn(&Context<'_>) -> Result<Outcome, Error>,
}

impl Experiment {
    /// Whether a key has an effect on this experiment.
    pub fn uses_key(&self, key: Key) -> bool {
        let name = key.assigned_name();
        let is_in = |given: &&str| {
            if given.ends_with('.') { name.starts_with(given) } else { name == *given }
        };
        self.uses.iter().copied().flatten().any(is_in)
            && !self.not.iter().copied().flatten().any(is_in)
    }

    /// The keys that it uses, in words.
    pub fn uses_text(&self) -> String {
        let words = |names: &[&str]| {
            let shown = names.iter().map(|name| match name.strip_suffix('.') {
                Some(group) => format!("{group}.*"),
                None => (*name).to_owned(),
            });
            shown.collect::<Vec<_>>().join(", ")
        };
        match (self.uses.concat().as_slice(), self.not.concat().as_slice()) {
            ([], _) => "no key".to_owned(),
            (uses, []) => words(uses),
            (uses, not) => format!("{}; except {}", words(uses), words(not)),
        }
    }

    /// Whether it takes an input file.
    fn takes_file(&self) -> bool {
        WITH_INPUT.iter().any(|with| with.name == self.name)
    }

    /// Checks that a file is given where one is needed, and nowhere else.
    ///
    /// # Errors
    /// [`Error::Refused`].
    pub fn check_file(&self, file: Option<&Path>) -> Result<(), Error> {
        let name = self.name;
        match (self.takes_file(), file) {
            (true, None) => Err(Error::Refused(format!("{name} needs --input FILE"))),
            (false, Some(file)) => {
                let (file, with) = (file.display(), WITH_INPUT.iter().map(|with| with.name));
                let with = with.collect::<Vec<_>>().join(", ");
                Err(Error::Refused(format!(
                    "--input {file}: {name} takes no file; allowed with: {with}"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Keys of the simulated motor, inverter and sensors.
pub const BENCH: &[&str] = &[
    "motor.",
    "saliency.",
    "plant",
    "flux_level",
    "iron.",
    "warming.",
    "inverter.",
    "dc_link.",
    "measurement.",
    "shaft.",
];
/// Keys of the drive.
pub const DRIVE: &[&str] = &[
    "drive.",
    "nameplate.",
    "scales.",
    "angle_source",
    "current_plant",
    "current_plant.",
    "ignore_delays",
    "injection.",
    "limits.",
    "sequence.",
    "speed.",
    "observer.",
    "braking.",
    "flux.",
    "vf.",
];
/// Keys of the speed loop, which a drive that regulates torque does not use.
pub const SPEED_LOOP: &[&str] = &[
    "speed.limit_rpm",
    "speed.ramp_rpm_per_s",
    "speed.quick_rpm_per_s",
    "speed.s_ramp_s",
    "speed.phase_margin_deg",
    "drive.motor.inertia",
];
/// Keys that do nothing while the shaft is locked or a dynamometer holds its speed.
pub const FREE_SHAFT: &[&str] = &["motor.inertia", "motor.friction", "shaft."];
/// Keys of the tracking of the saliency, which a drive with an encoder does not use.
pub const TRACKING: &[&str] =
    &["injection.bandwidth_hz", "injection.flux_saliency", "injection.current_saliency"];
/// Keys that do nothing while the shaft is locked.
pub const TURNING: &[&str] =
    &["motor.inertia", "motor.friction", "shaft.", "motor.pole_pairs", "drive.motor.pole_pairs"];

/// All experiments, in the order of the report.
#[rustfmt::skip] // one a line: the list grows
pub const EXPERIMENTS: &[Experiment] = &[
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
    smallest_slope::EXPERIMENT,
    identify_discrete::EXPERIMENT,
    identify_continuous::EXPERIMENT,
    identify_recursive::EXPERIMENT,
    identify_validate::EXPERIMENT,
    identify_machine::EXPERIMENT,
    motor_tests::EXPERIMENT,
    online_tracking::EXPERIMENT,
    measured_motors::EXPERIMENT,
];

/// The experiments that need an input file; they are no part of the report.
pub const WITH_INPUT: &[Experiment] = &[scenario::PROFILE];

/// The experiments of many independent runs, which can be shared between machines and continued.
pub const STATISTICAL: &[Statistical] = &[
    Statistical::of::<monte_carlo::MonteCarlo>(),
    Statistical::of::<machines::Machines>(),
    Statistical::of::<commission::Commission>(),
    Statistical::of::<commission::refusals::Refusals>(),
    Statistical::of::<battery::Battery>(),
    Statistical::of::<full_range::FullRange>(),
    Statistical::of::<lock_monitor::LockMonitor>(),
    Statistical::of::<smallest_slope::SmallestSlope>(),
];

/// The runs of the experiment with this name.
///
/// # Errors
/// [`Error::Refused`] when it is not a statistical one.
pub fn statistical(name: &str) -> Result<&'static Statistical, Error> {
    let found = STATISTICAL.iter().find(|statistical| statistical.experiment.name == name);
    found.ok_or_else(|| {
        let known: Vec<_> = STATISTICAL.iter().map(|known| known.experiment.name).collect();
        Error::Refused(format!(
            "{name} does not consist of independent runs; those that do: {}",
            known.join(", ")
        ))
    })
}

/// Experiments that are gone, and what does the same.
const REPLACED: &[(&str, &str)] = &[
    ("tracking", "`run record`, `run torque-steps` and `run perturbation`"),
    ("torque-drift", "`run record --set record.minutes=1`"),
    ("speed-torque-sweep", "`run full-range --set full_range.kind=constant`"),
    ("saliency-check", "`run smallest-slope`"),
];

/// The experiment that runs without a command.
pub const DEFAULT: &str = "torque-steps";

/// The experiments that a name on the command line means: one, or a group of all whose names begin with
/// it and a hyphen, as `identify`. An unknown name is returned as it is.
pub fn named(name: &str) -> Vec<&str> {
    let known = || EXPERIMENTS.iter().map(|experiment| experiment.name);
    let begins = format!("{name}-");
    let group: Vec<&str> = known().filter(|known| known.starts_with(&begins)).collect();
    if group.len() < 2 || known().any(|known| known == name) { vec![name] } else { group }
}

/// The experiment with this name.
///
/// # Errors
/// [`Error::Unknown`] with the most similar name; [`Error::Refused`] with what took the place of an experiment that is gone.
pub fn find(name: &str) -> Result<&'static Experiment, Error> {
    let mut all = EXPERIMENTS.iter().chain(WITH_INPUT);
    if let Some(experiment) = all.find(|experiment| experiment.name == name) {
        return Ok(experiment);
    }
    let names = EXPERIMENTS.iter().chain(WITH_INPUT).map(|experiment| experiment.name);
    Err(match REPLACED.iter().find(|(old, _)| *old == name) {
        Some((_, by)) => Error::Refused(format!("the experiment `{name}` is gone; use {by}")),
        None => Error::unknown("experiment", name, names),
    })
}

/// Runs the experiment with this name for its own time, and shows no progress.
///
/// # Errors
/// As [`find`], and the errors of the experiment.
pub fn run(name: &str, config: &Config, seed: u64) -> Result<Outcome, Error> {
    let context = Context { config, seed, seconds: None, progress: Progress::hidden(), file: None };
    (find(name)?.run)(&context)
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
        let config = Config::default();
        let context = Context {
            config: &config,
            seed: 1,
            seconds: None,
            progress: Progress::hidden(),
            file: None,
        };
        let outcome = (amplitude::EXPERIMENT.run)(&context).unwrap();
        let rms = |volts: u32| outcome.metrics.get(&format!("rms_at_{volts}_v_deg")).unwrap();
        assert!((0.1..5.0).contains(&rms(80)) && rms(80) < rms(40), "more carrier, less noise");
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
