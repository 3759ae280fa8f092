//! The experiments. Each is one function from a [`Context`] to an [`Outcome`].
#![deny(clippy::use_debug)]

mod adc_calibration;
mod angle_identification;
mod anti_windup;
mod bode;
mod current_step;
mod dead_time;
mod demodulators;
mod filters;
mod identify_continuous;
mod identify_discrete;
mod identify_machine;
mod identify_recursive;
mod identify_validate;
mod injection_map;
mod learn_reference;
pub mod learning;
mod linear_model;
mod lock_monitor;
mod machines;
mod modulation;
mod monte_carlo;
mod motor_tests;
mod online_tracking;
mod orientation;
mod perturbation;
mod pi_design;
mod plant_identification;
mod position;
mod reversal;
mod saliency_check;
mod sensorless_position;
mod speed_profile;
mod steady;
mod sweep;
mod torque;
mod torque_drift;
mod tracking;
pub mod warming_rotor;

pub use torque::assumptions;

use rayon::prelude::*;

use crate::config::Config;
use crate::error::{Error, nearest};
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
    /// Runs it.
    pub run: fn(&Context<'_>) -> Result<Outcome, Error>,
}

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
    demodulators::EXPERIMENT,
    angle_identification::EXPERIMENT,
    learn_reference::EXPERIMENT,
    saliency_check::EXPERIMENT,
    position::EXPERIMENT,
    sensorless_position::EXPERIMENT,
    torque::STEPS,
    torque::RAMP,
    reversal::EXPERIMENT,
    perturbation::EXPERIMENT,
    speed_profile::EXPERIMENT,
    sweep::EXPERIMENT,
    monte_carlo::EXPERIMENT,
    machines::EXPERIMENT,
    lock_monitor::EXPERIMENT,
    torque_drift::EXPERIMENT,
    tracking::EXPERIMENT,
    identify_discrete::EXPERIMENT,
    identify_continuous::EXPERIMENT,
    identify_recursive::EXPERIMENT,
    identify_validate::EXPERIMENT,
    identify_machine::EXPERIMENT,
    motor_tests::EXPERIMENT,
    online_tracking::EXPERIMENT,
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
/// [`Error::UnknownExperiment`] with the most similar name.
pub fn find(name: &str) -> Result<&'static Experiment, Error> {
    EXPERIMENTS.iter().find(|experiment| experiment.name == name).ok_or_else(|| {
        Error::UnknownExperiment {
            name: name.to_owned(),
            nearest: nearest(name, EXPERIMENTS.iter().map(|experiment| experiment.name))
                .map(str::to_owned),
        }
    })
}

/// Runs the experiment with this name for its own time, and shows no progress.
///
/// # Errors
/// As [`find`], and the errors of the experiment.
pub fn run(name: &str, config: &Config, seed: u64) -> Result<Outcome, Error> {
    let context = Context { config, seed, seconds: None, progress: Progress::hidden() };
    (find(name)?.run)(&context)
}

#[cfg(test)]
mod tests {
    use super::*;

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
