//! The full speed range: torque, load steps, ramps, wrong parameters, rotated flux, flying starts, and the dc link, for
//! each region of the speed.
//!
//! Model A runs with a magnetising current of 1.4 A and the energy model with high flux, unless the settings say
//! otherwise or the drive commissions itself. The drive first learns its tables at that current. Keys `after.NAME`
//! change the motor or the sensors afterwards.

mod case;
mod summary;
mod trial;

use std::sync::OnceLock;

use case::Case;

use super::battery::{Learnt, learned_drive, once};
use super::commission::commissioned;
use super::course::Trial;
use crate::config::{FluxLevel, RangeKind};
use crate::prelude::*;

/// Number of runs of a kind in a region, unless `runs` sets another.
const RUNS: u32 = 10;
/// Magnetising current of model A, A on the dissertation's motor.
pub const I_D_A: f64 = 1.4;
/// Settings of the drive for the full range, if they are not set: largest speed and over-speed trip, rpm, and ramp,
/// rpm/s, on four poles.
const LIMIT_RPM: f64 = 3600.0;
const TRIP_RPM: f64 = 4500.0;
const RAMP_RPM_PER_S: f64 = 1000.0;
/// Errors of the motor parameters in a drive whose motor has changed after the saliency self-commissioning: leakage
/// inductance, stator resistance, magnetising inductance; each with both signs.
const WRONG: (f64, f64, f64) = (0.05, 0.3, 0.1);
/// Number of drives: one for the motor's own shaft, and one for a heavy shaft.
const DRIVES: usize = 2;

/// Adds settings that the full range needs to a configuration that does not have them.
///
/// # Errors
/// As [`check_model`].
pub fn for_the_range(config: &Config) -> Result<Config, Error> {
    let mut config = config.clone();
    let speed = |rpm: f64| Some(config.rpm(rpm) as f32);
    let (limit, trip, ramp) = (speed(LIMIT_RPM), speed(TRIP_RPM), speed(RAMP_RPM_PER_S));
    let i_d = config.amperes(I_D_A) as f32;
    let drive = &mut config.drive;
    drive.observer.enabled = true;
    drive.speed.limit_rpm = drive.speed.limit_rpm.or(limit);
    drive.speed.ramp_rpm_per_s = drive.speed.ramp_rpm_per_s.or(ramp);
    drive.limits.speed_rpm = drive.limits.speed_rpm.or(trip);
    if drive.sequence.i_d.is_none() {
        match config.model.plant {
            PlantModel::A if drive.sequence.flux == Flux::High => {}
            PlantModel::A => drive.sequence.i_d = Some(i_d),
            _ => (drive.sequence.flux, config.model.flux_level) = (Flux::High, FluxLevel::High),
        }
    }
    check_model(&config)?;
    Ok(config)
}

/// The runs, with the cases in alternation.
pub struct FullRange {
    config: Config,
    seed: u64,
    cases: Vec<Case>,
    /// The numbers of the runs.
    numbers: Vec<usize>,
    drives: [OnceLock<Learnt>; DRIVES],
}

impl FullRange {
    fn case(&self, number: usize) -> Case {
        self.cases[number % self.cases.len()]
    }

    /// Returns a motor that differs from the drive's parameters: one of eight combinations of the signs.
    fn changed(&self, number: usize, config: &Config) -> Config {
        let (mut config, choice) = (config.clone(), number / self.cases.len());
        let believed =
            |bit: usize, by: f64| if choice >> bit & 1 == 1 { 1.0 + by } else { 1.0 - by };
        let motor = &mut config.motor;
        motor.l_ls /= believed(0, WRONG.0);
        motor.l_lr /= believed(0, WRONG.0);
        motor.r_s /= believed(1, WRONG.1);
        motor.l_m /= believed(2, WRONG.2);
        config
    }

    /// Returns the drive of a run, which has learned if it can.
    fn drive(&self, case: Case, config: &Config) -> Result<&Learnt, Error> {
        let place = &self.drives[usize::from(case.kind == RangeKind::Braking)];
        once(place, || learned_drive(config, self.seed))
    }

    /// Does a run; with `traced` it also records the curves.
    fn done(&self, number: usize, traced: bool) -> Result<(Trial, Vec<Point>), Error> {
        let (case, seed) = (self.case(number), seed_of(self.seed, number));
        let mut config = self.config.clone();
        trial::set_up(case, &mut config);
        let mut bench = config.after_learning()?;
        let drive = match self.drive(case, &config)? {
            Err(fault) => return Ok((Trial::unlearned(seed, *fault), Vec::new())),
            Ok(drive) => drive,
        };
        if case.kind == RangeKind::WrongParameters {
            bench = self.changed(number, &bench);
        }
        trial::trial(case, &bench, drive, seed, traced)
    }
}

impl Study for FullRange {
    type Record = Trial;
    const NAME: &'static str = "full-range";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let mut config = for_the_range(context.config)?;
        if config.prepare.commission {
            config.drive = commissioned(&config, context.seed)?;
        }
        let cases = Case::all(config.full_range.kind);
        let each = config.extent.runs.unwrap_or(RUNS) as usize;
        let numbers = match config.full_range.index {
            Some(index) => vec![index as usize],
            None => (0..each * cases.len()).collect(),
        };
        let (runs, drives) = (numbers.len(), std::array::from_fn(|_| OnceLock::new()));
        Ok((Self { config, seed: context.seed, cases, numbers, drives }, runs))
    }

    fn run(&self, place: usize) -> Result<Trial, Error> {
        Ok(self.done(self.numbers[place], false)?.0)
    }

    fn outcome(&self, _: &Context<'_>, runs: Vec<Trial>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        let done: Vec<_> =
            self.numbers.iter().zip(runs).map(|(&n, run)| (self.case(n), n, run)).collect();
        summary::of(&self.cases, &done, &mut outcome);
        if let Some(index) = self.config.full_range.index {
            outcome.figures.push(summary::figure(&self.done(index as usize, true)?.1));
        }
        Ok(outcome)
    }
}
