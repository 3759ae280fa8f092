//! The stress test: runs that disturb the angle, on any simulated motor.
//!
//! The runs and the verdicts come from a study of this drive on an independent saturating motor. It is important not
//! only how large the error is, but also whether the drive detects it. A run is *lost* if the error exceeds 45° at any
//! time. It is *wrong* if the error exceeds 30° for more than 0.5 s while the drive regulates. Its *flux is off* if the
//! flux is below half or above twice its nominal value for as long. It is *silent* (undetected) if it is wrong or its
//! flux is off.

mod run;
mod summary;

use std::sync::OnceLock;

pub use run::{learned_drive, trial};
pub use summary::Summary;

use super::course::{KINDS, Kind, Trial, chosen};
use super::disturbed;
use crate::prelude::*;

/// Number of runs after which the drive repeats the saliency self-commissioning.
const GROUP: usize = KINDS.len();

/// Random numbers other than the noise have their own seeds.
const LEARNING: u64 = 1 << 40;
const DRAWN: u64 = 2 << 40;

/// A drive, or the number of the fault with which it refused the saliency self-commissioning.
pub(super) type Learnt = Result<Drive, u8>;

/// Returns a value that the first run that needs it makes.
pub(super) fn once<T>(
    place: &OnceLock<T>,
    make: impl FnOnce() -> Result<T, Error>,
) -> Result<&T, Error> {
    match place.get() {
        Some(made) => Ok(made),
        // If two threads come at once, both make the same value.
        None => make().map(|made| place.get_or_init(|| made)),
    }
}

/// The runs of the stress test.
pub struct Battery {
    config: Config,
    /// The bench after the saliency self-commissioning.
    after: Config,
    seed: u64,
    kinds: Vec<Kind>,
    /// The drive of each group.
    drives: Vec<OnceLock<Learnt>>,
}

impl Battery {
    /// Returns the group of a run. All runs are one group unless the drive repeats the saliency self-commissioning.
    fn group(&self, number: usize) -> usize {
        let many = self.config.battery.relearn || self.config.disturbed.drawn > 0.0;
        if many { number / GROUP } else { 0 }
    }

    /// Sizes of the disturbances that are always present, and of those that appear after the saliency self-commissioning.
    fn sizes(&self, number: usize) -> [Vec<f64>; 2] {
        let group = seed_of(self.seed, self.group(number)) ^ LEARNING;
        let run = seed_of(self.seed, number) ^ DRAWN;
        [
            disturbed::sizes(&self.config, &disturbed::ALWAYS, group),
            disturbed::sizes(&self.config, &disturbed::AFTER, run),
        ]
    }

    /// Returns the drive of a group; with `prepare.learn` it has done the saliency self-commissioning.
    fn drive(&self, number: usize) -> Result<&Learnt, Error> {
        let (group, config) = (self.group(number), &self.config);
        once(&self.drives[group], || {
            if !config.prepare.learn {
                return Ok(Ok(Drive::new(built(&config.drive)?)));
            }
            let mut bench = config.clone();
            disturbed::add(&mut bench, &disturbed::ALWAYS, &self.sizes(number)[0]);
            let seed = if group == 0 { self.seed } else { seed_of(self.seed, group) ^ LEARNING };
            learned_drive(&bench, seed)
        })
    }

    /// Describes the disturbances of a run in words, in % of their full sizes.
    fn disturbances(&self, number: usize) -> String {
        let [always, after] = self.sizes(number);
        let all =
            disturbed::ALWAYS.iter().chain(&disturbed::AFTER).zip(always.iter().chain(&after));
        let acting = all.filter(|(_, size)| **size != 0.0);
        let words = acting.map(|(one, size)| format!("{}: {:.0} %", one.0, 100.0 * size));
        words.collect::<Vec<_>>().join(", ")
    }
}

impl Study for Battery {
    type Record = Trial;
    const NAME: &'static str = "battery";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let config = context.config.clone();
        check_model(&config)?;
        let after = config.after_learning()?;
        let (kinds, runs) = chosen(&config);
        let runs = config.extent.runs.map_or(runs, |runs| runs as usize);
        let drives = std::iter::repeat_with(OnceLock::new).take(runs.div_ceil(GROUP)).collect();
        Ok((Self { config, after, seed: context.seed, kinds, drives }, runs))
    }

    fn run(&self, number: usize) -> Result<Trial, Error> {
        let kind = self.kinds[number % self.kinds.len()];
        let seed = seed_of(self.seed, number);
        match self.drive(number)? {
            Ok(drive) => {
                let mut bench = self.after.clone();
                let [always, after] = self.sizes(number);
                disturbed::add(&mut bench, &disturbed::ALWAYS, &always);
                disturbed::add(&mut bench, &disturbed::AFTER, &after);
                if let Kind::Dragged(asymmetry) = kind {
                    asymmetry.add(&mut bench);
                }
                trial(&bench, drive, kind, seed)
            }
            Err(fault) => Ok(Trial { kind: Some(kind), ..Trial::unlearned(seed, *fault) }),
        }
    }

    fn outcome(&self, _: &Context<'_>, trials: Vec<Trial>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        Summary::of(&trials).metrics(&mut outcome.metrics);
        let failures = trials.iter().enumerate().filter_map(|(number, trial)| {
            trial.failure().map(|failure| format!("run {number}: {failure}"))
        });
        outcome.faults.extend(failures);
        outcome.tables.push(summary::by_kind(&trials));
        if trials.iter().any(Trial::is_silent) {
            outcome.tables.push(summary::silent(&trials, |number| self.disturbances(number)));
        }
        outcome.figures.push(summary::figure(&trials));
        Ok(outcome)
    }
}
