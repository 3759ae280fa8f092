//! One run of the battery.

use std::f64::consts::TAU;

use drive_core::{Compare, Fault};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::drive::{Condition, DriveUnderTest, Purpose};
use super::kind::{Kind, Part, Shaft};
use crate::config::{Config, open_phase};
use crate::error::Error;
use crate::experiments::torque::LOST_DEG;
use crate::plant::{Load, Plant, PlantSettings};
use crate::rig::{RATE_HZ, wrapped_degrees};
use crate::stats::Stats;

/// An error beyond this, degrees, is wrong.
const WRONG_DEG: f64 = 30.0;
/// Flux in relation to its nominal value that is off: below the first, above the second.
const FLUX_OFF: (f64, f64) = (0.5, 2.0);
/// A state that lasts longer, s, should have been noticed.
pub const UNNOTICED_S: f64 = 0.5;
/// A state lasts on over interruptions up to this, s: an angle that runs through has a sound one now and then.
const GAP_S: f64 = 0.1;
/// Time after the first reference that the statistics of the error leave out, s: the angle settles.
const SETTLING_S: f64 = 0.5;
/// Pace of a reference that changes gradually, s.
const PACE_S: f64 = 0.01;
/// How fast the dynamometer gets up to speed, rpm/s.
const RAMP_RPM_PER_S: f64 = 600.0;
/// Longest start and longest learning, s.
const LONGEST_START_S: f64 = 30.0;
const LONGEST_LEARNING_S: f64 = 1000.0;
/// Classes of the histogram in a degree.
pub const CLASSES_PER_DEG: f64 = 10.0;

/// The result of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Trial {
    /// Its kind.
    pub kind: Kind,
    /// Its seed.
    pub seed: u64,
    /// Angle error while the drive regulated, true minus estimated, degrees.
    pub error: Stats,
    /// How often the magnitude was in each class of 0.1° that occurred: number of the class, and of samples.
    pub histogram: Vec<(u32, u32)>,
    /// Largest error from the start on, that of a shaft brought up to speed and of the settling included, degrees.
    pub largest_deg: f64,
    /// Longest time for which the angle was wrong while the drive regulated, s.
    pub wrong_s: f64,
    /// Longest time for which the flux was off while the drive regulated, s.
    pub flux_off_s: f64,
    /// Number of the fault that stopped the drive while it regulated.
    pub trip: Option<u8>,
    /// Number of the fault with which the drive refused to start, or before that to learn.
    pub refused: Option<u8>,
}

impl Trial {
    fn new(kind: Kind, seed: u64) -> Self {
        Self {
            kind,
            seed,
            error: Stats::default(),
            histogram: Vec::new(),
            largest_deg: 0.0,
            wrong_s: 0.0,
            flux_off_s: 0.0,
            trip: None,
            refused: None,
        }
    }

    /// A run that was refused with this fault.
    pub fn refused(kind: Kind, seed: u64, fault: u8) -> Self {
        Self { refused: Some(fault), ..Self::new(kind, seed) }
    }

    /// Whether the error was beyond 45° while the drive regulated.
    pub fn is_lost(&self) -> bool {
        self.largest_deg > LOST_DEG
    }

    /// Whether the angle was wrong for so long that the drive should have noticed.
    pub fn is_wrong(&self) -> bool {
        self.wrong_s > UNNOTICED_S
    }

    /// Whether the flux was off for so long.
    pub fn is_flux_off(&self) -> bool {
        self.flux_off_s > UNNOTICED_S
    }

    /// The reason why the run is none that a drive should have, after its kind and seed.
    pub fn failure(&self) -> Option<String> {
        let fault = |code: u8| {
            let fault = Fault::ALL.iter().find(|fault| fault.code() == code);
            let text = fault.map_or(String::new(), |fault| format!(": {fault}"));
            format!("fault {code}{text}")
        };
        let reason = match self {
            Self { refused: Some(code), .. } => format!("start refused with {}", fault(*code)),
            Self { trip: Some(code), .. } => fault(*code),
            _ if self.is_lost() => format!("angle error beyond {LOST_DEG}°"),
            _ if self.is_wrong() => format!("angle wrong for {:.2} s", self.wrong_s),
            _ if self.is_flux_off() => format!("flux off for {:.2} s", self.flux_off_s),
            _ => return None,
        };
        Some(format!("{}, seed {}: {reason}", self.kind.name(), self.seed))
    }
}

/// How long a state lasts at the longest.
#[derive(Default)]
struct Lasting {
    since: Option<f64>,
    last: f64,
    longest: f64,
}

impl Lasting {
    fn push(&mut self, t: f64, is: bool) {
        if is {
            let since = *self.since.get_or_insert(t);
            (self.last, self.longest) = (t, self.longest.max(t - since));
        } else if t - self.last > GAP_S {
            self.since = None;
        }
    }
}

/// A drive and a plant, and what is seen of them.
struct Bench<D> {
    plant: Plant,
    drive: D,
    pending: Compare,
    periods: u64,
    /// Flux of the magnetising current, Wb.
    nominal_flux: f64,
    /// Time from which on the error is counted, s; unset before the first reference.
    counted_from: Option<f64>,
    counts: Vec<u32>,
    wrong: Lasting,
    flux_off: Lasting,
}

impl<D: DriveUnderTest> Bench<D> {
    fn new(
        config: &Config,
        plant: &PlantSettings,
        drive: &D,
        load: Load,
        seed: u64,
    ) -> Result<Self, Error> {
        let mut settings = *plant;
        settings.mechanics.load = load;
        let mut plant = Plant::new(&settings, seed).map_err(Error::refused)?;
        plant.set_open_phase(open_phase(config)).map_err(Error::refused)?;
        Ok(Self {
            plant,
            drive: drive.clone(),
            pending: Compare::OFF,
            periods: 0,
            nominal_flux: settings.machine.lm * f64::from(config.drive.i_d()),
            counted_from: None,
            counts: vec![0; (180.0 * CLASSES_PER_DEG) as usize + 1],
            wrong: Lasting::default(),
            flux_off: Lasting::default(),
        })
    }

    fn time(&self) -> f64 {
        self.periods as f64 / RATE_HZ
    }

    /// One period; the plant is delayed as [`drive_core::io`] says.
    fn step(&mut self) {
        let sample = self.plant.sample();
        let compare = self.drive.step(&sample);
        if !compare.enabled {
            self.pending = Compare::OFF;
        }
        self.plant.advance(&self.pending, 1.0 / RATE_HZ);
        self.pending = compare;
        self.periods += 1;
    }

    /// Until the drive has left [`Condition::Busy`], or for so many seconds.
    fn wait(&mut self, seconds: f64) -> Condition {
        for _ in 0..(seconds * RATE_HZ) as u64 {
            self.step();
            if self.drive.condition() != Condition::Busy {
                break;
            }
        }
        self.drive.condition()
    }

    /// Runs for some seconds, or until the drive no longer regulates; says whether it still does.
    fn watch(&mut self, seconds: f64, trial: &mut Trial) -> bool {
        for _ in 0..(seconds * RATE_HZ).round() as u64 {
            let (t, flux) = (self.time(), self.plant.rotor_flux());
            self.step();
            if self.drive.condition() != Condition::Regulating {
                return false;
            }
            let error = wrapped_degrees(flux.arg() - self.drive.flux_turns() * TAU);
            let share = flux.norm() / self.nominal_flux;
            trial.largest_deg = trial.largest_deg.max(error.abs());
            self.wrong.push(t, error.abs() > WRONG_DEG);
            self.flux_off.push(t, share < FLUX_OFF.0 || share > FLUX_OFF.1);
            if self.counted_from.is_some_and(|from| t >= from) {
                trial.error.push(error);
                self.counts[(error.abs() * CLASSES_PER_DEG) as usize] += 1;
            }
        }
        true
    }
}

/// Lets a drive learn with the shaft locked; returns it off, or the number of the fault with which it refused.
///
/// # Errors
/// When the plant is refused, or the drive neither learns nor says why.
pub fn learned<D: DriveUnderTest>(
    config: &Config,
    plant: &PlantSettings,
    drive: D,
    seed: u64,
) -> Result<Result<D, u8>, Error> {
    let mut bench = Bench::new(config, plant, &drive, Load::Locked, seed)?;
    let refused = |why| Error::Refused(format!("the drive does not learn: {why}"));
    bench.drive.start(Purpose::Learning).map_err(refused)?;
    match bench.wait(LONGEST_LEARNING_S) {
        Condition::Off => Ok(Ok(bench.drive)),
        Condition::Fault(code) => Ok(Err(code)),
        other => Err(Error::Internal(format!(
            "after {LONGEST_LEARNING_S} s of learning the drive is {other}"
        ))),
    }
}

/// Does one run with a copy of a drive that is off. The configuration scales currents, speeds and torques.
///
/// # Errors
/// When the plant is refused, or the drive refuses a command.
pub fn trial<D: DriveUnderTest>(
    config: &Config,
    plant: &PlantSettings,
    drive: &D,
    kind: Kind,
    seed: u64,
) -> Result<Trial, Error> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let parts = kind.parts(&mut random);
    let mut trial = Trial::new(kind, seed);
    let (load, purpose) = match kind.shaft() {
        Shaft::Locked => (Load::Locked, Purpose::Torque),
        Shaft::Held(_) => (Load::Speed { speed: 0.0 }, Purpose::Torque),
        Shaft::Free => (Load::Free { torque: 0.0 }, Purpose::Speed),
    };
    let mut bench = Bench::new(config, plant, drive, load, seed)?;
    bench.drive.start(purpose).map_err(Error::Refused)?;
    match bench.wait(LONGEST_START_S) {
        Condition::Regulating => {}
        Condition::Fault(code) => return Ok(Trial { refused: Some(code), ..trial }),
        other => return Err(Error::Internal(format!("after a start the drive is {other}"))),
    }
    let still = bring_up(&mut bench, kind.shaft(), config, &mut trial)?
        && follow(&mut bench, purpose, config, &parts, &mut trial)?;
    if !still && let Condition::Fault(code) = bench.drive.condition() {
        trial.trip = Some(code);
    }
    trial.wrong_s = bench.wrong.longest;
    trial.flux_off_s = bench.flux_off.longest;
    let classes = (0..).zip(bench.counts).filter(|(_, count)| *count > 0);
    trial.histogram = classes.collect();
    Ok(trial)
}

/// Brings a held shaft up to speed without torque.
fn bring_up<D: DriveUnderTest>(
    bench: &mut Bench<D>,
    shaft: Shaft,
    config: &Config,
    trial: &mut Trial,
) -> Result<bool, Error> {
    let Shaft::Held(rpm) = shaft else { return Ok(true) };
    let speed = config.rpm(rpm) * TAU / 60.0;
    let steps = (rpm.abs() / RAMP_RPM_PER_S / PACE_S).ceil() as u32;
    for n in 1..=steps {
        let speed = speed * f64::from(n) / f64::from(steps);
        bench.plant.set_load(Load::Speed { speed }).map_err(Error::refused)?;
        if !bench.watch(PACE_S, trial) {
            return Ok(false);
        }
    }
    Ok(bench.watch(0.3, trial))
}

/// Follows the references; says whether the drive regulated to the end.
fn follow<D: DriveUnderTest>(
    bench: &mut Bench<D>,
    purpose: Purpose,
    config: &Config,
    parts: &[Part],
    trial: &mut Trial,
) -> Result<bool, Error> {
    bench.counted_from = Some(bench.time() + SETTLING_S);
    for part in parts {
        if purpose == Purpose::Speed {
            let torque = config.newton_metres(part.load_nm);
            bench.plant.set_load(Load::Free { torque }).map_err(Error::refused)?;
        }
        let (from, to) = part.reference;
        let steps = if from == to { 1 } else { (part.seconds / PACE_S).round() as u32 };
        for n in 1..=steps {
            let reference = from + (to - from) * f64::from(n) / f64::from(steps);
            let given = match purpose {
                Purpose::Speed => bench.drive.speed(config.rpm(reference) as f32),
                _ => bench.drive.torque(config.amperes(reference) as f32),
            };
            given.map_err(Error::Refused)?;
            if !bench.watch(part.seconds / f64::from(steps), trial) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_lasts_over_short_interruptions_only() {
        let mut lasting = Lasting::default();
        let mut at = |from: f64, to: f64, is: bool| {
            (0..((to - from) * 1e3).round() as u32)
                .for_each(|n| lasting.push(from + f64::from(n) * 1e-3, is));
            lasting.longest
        };
        assert!((at(0.0, 0.2, true) - 0.199).abs() < 1e-9);
        at(0.2, 0.29, false);
        // Interrupted for 0.09 s: one stretch from 0 on.
        assert!((at(0.29, 0.4, true) - 0.399).abs() < 1e-9);
        at(0.4, 0.6, false);
        // Interrupted for 0.2 s: a new one, which is shorter.
        assert!((at(0.6, 0.9, true) - 0.399).abs() < 1e-9);
        assert!((at(0.9, 1.2, true) - 0.599).abs() < 1e-9);
    }
}
