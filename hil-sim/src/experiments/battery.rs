//! The battery: twelve kinds of runs that shake the angle, on any simulated motor and with any drive.
//!
//! The runs and the verdicts are those of a study of this drive on an independent saturating motor: what counts is not
//! the error alone but whether the drive notices. A run is *lost* when the error is beyond 45° at any time, *wrong* when
//! it is beyond 30° for more than 0.5 s while the drive regulates, and its *flux is off* when the flux is below half or
//! above twice its nominal value for as long.

mod drive;
mod kind;
mod summary;
mod trial;

use std::sync::OnceLock;

pub use drive::{Condition, DriveUnderTest, Purpose};
pub use kind::{KINDS, Kind};
pub use summary::Summary;
pub use trial::{Trial, learned, trial};

use drive_core::Drive;
use drive_core::carrier::DemodulatorKind;
use drive_core::settings::AngleSource;

use super::statistics::{Study, whole};
use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment};
use crate::config::{Config, check_model, plant_settings};
use crate::error::Error;
use crate::outcome::Outcome;

/// Not in the source.
pub const EXPERIMENT: Experiment = Experiment {
    name: "battery",
    stands_for: "what section 5.2 leaves open",
    about: "Twelve kinds of runs, four of each: angle error, and what the drive does not notice; `--set runs=N`.",
    uses: &[BENCH, DRIVE, &["prepare.learn", "runs"]],
    not: &[],
    run: whole::<Battery>,
};

/// Runs, unless `runs` says otherwise: four of each kind.
pub const RUNS: usize = 4 * KINDS.len();

/// The seed of a run.
pub fn seed_of(seed: u64, number: usize) -> u64 {
    seed.wrapping_mul(1_000_003).wrapping_add(number as u64)
}

/// The runs.
pub struct Battery {
    config: Config,
    seed: u64,
    /// The drive that all runs begin with, or the number of the fault with which it refused to learn.
    drive: OnceLock<Result<Drive, u8>>,
}

impl Battery {
    /// The drive of the configuration; with `prepare.learn` it has learned.
    fn drive(&self) -> Result<&Result<Drive, u8>, Error> {
        if let Some(drive) = self.drive.get() {
            return Ok(drive);
        }
        let (config, settings) = (&self.config, &self.config.drive);
        let drive = Drive::new(settings.build().map_err(Error::refused)?);
        let tracks = settings.angle_source == AngleSource::Injection
            && settings.injection.demodulator == DemodulatorKind::Synchronous;
        let drive = match config.prepare.learn && tracks {
            true => learned(config, &plant_settings(config), drive, self.seed)?,
            false => Ok(drive),
        };
        // Two threads that came at once found the same.
        Ok(self.drive.get_or_init(|| drive))
    }
}

impl Study for Battery {
    type Record = Trial;
    const EXPERIMENT: &'static Experiment = &EXPERIMENT;

    fn new(context: &Context<'_>) -> Result<Self, Error> {
        check_model(context.config)?;
        let (config, drive) = (context.config.clone(), OnceLock::new());
        Ok(Self { config, seed: context.seed, drive })
    }

    fn runs(&self) -> usize {
        self.config.extent.runs.map_or(RUNS, |runs| runs as usize)
    }

    fn run(&self, number: usize) -> Result<Trial, Error> {
        let (kind, seed) = (KINDS[number % KINDS.len()], seed_of(self.seed, number));
        match self.drive()? {
            Ok(drive) => trial(&self.config, &plant_settings(&self.config), drive, kind, seed),
            Err(fault) => Ok(Trial::refused(kind, seed, *fault)),
        }
    }

    fn outcome(&self, _: &Context<'_>, trials: Vec<Trial>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        Summary::of(&trials).metrics(&mut outcome.metrics);
        outcome.faults.extend(trials.iter().filter_map(Trial::failure));
        outcome.tables.push(summary::by_kind(&trials));
        outcome.figures.push(summary::figure(&trials));
        outcome.remarks = assumptions(&self.config);
        outcome.remarks.push(summary::REMARK.to_owned());
        Ok(outcome)
    }
}
