//! One run of the battery.

use std::f64::consts::TAU;

use drive_core::Fault;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use super::bench::{Bench, CLASSES_PER_DEG};
use super::drive::{Condition, DriveUnderTest, Purpose};
use super::kind::{Kind, Part, Shaft, nominal_limit_a, torque_nm};
use crate::config::Config;
use crate::error::Error;
use crate::experiments::torque::LOST_DEG;
use crate::plant::{Load, PlantSettings};
use crate::stats::Stats;

/// A state that lasts longer, s, should have been noticed.
pub const UNNOTICED_S: f64 = 0.5;
/// Time after the first reference that the statistics of the error leave out, s: the angle settles.
const SETTLING_S: f64 = 0.5;
/// Pace of a reference that changes gradually, s.
const PACE_S: f64 = 0.01;
/// How fast the dynamometer gets up to speed, rpm/s.
const RAMP_RPM_PER_S: f64 = 600.0;
/// Longest start and longest learning, s.
const LONGEST_START_S: f64 = 30.0;
const LONGEST_LEARNING_S: f64 = 1000.0;
/// The last class of the histogram, that of 180°.
pub const LARGEST_CLASS: usize = (180.0 * CLASSES_PER_DEG) as usize;
/// A learned limit below this share of the nominal one is a lower one.
const LIMITED_SHARE: f64 = 0.999;

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
    /// Largest error from the start on, that of a shaft brought up to speed and of the settling included, and none
    /// after the flux was turned; degrees.
    pub largest_deg: f64,
    /// Longest time for which the angle was wrong while the drive regulated, s; after a turn of the flux, if there is one.
    pub wrong_s: f64,
    /// Longest time for which the flux was off while the drive regulated, s; likewise.
    pub flux_off_s: f64,
    /// Whether the angle was wrong or the flux off to the end of the run, and long enough to be noticed.
    pub stuck: bool,
    /// Torque current that the drive allows, in relation to the [nominal limit](super::nominal_limit_a).
    pub limit_share: Option<f64>,
    /// Mean torque of the motor minus that of the torque current that the drive has taken, in the direction of the
    /// latter and in relation to the torque at the nominal limit; of a run at constant torque that reached its end.
    pub torque_error: Option<f64>,
    /// Number of the fault that stopped the drive while it regulated.
    pub trip: Option<u8>,
    /// Whether angle and flux were sound from the first reference until then.
    pub sound_stop: bool,
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
            stuck: false,
            limit_share: None,
            torque_error: None,
            trip: None,
            sound_stop: false,
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

    /// Whether the drive was silently wrong: angle or flux, for so long.
    pub fn is_silent(&self) -> bool {
        self.is_wrong() || self.is_flux_off()
    }

    /// Whether the drive has learned a lower limit of the torque current than the nominal one.
    pub fn is_limited(&self) -> bool {
        self.limit_share.is_some_and(|share| share < LIMITED_SHARE)
    }

    /// The reason why the run is none that a drive should have, after its kind and seed.
    pub fn failure(&self) -> Option<String> {
        let fault = |code: u8| {
            let fault = Fault::ALL.iter().find(|fault| fault.code() == code);
            let text = fault.map_or(String::new(), |fault| format!(": {fault}"));
            format!("fault {code}{text}")
        };
        let stops = self.trip.filter(|_| !self.kind.turns_flux());
        let reasons = [
            self.refused.map(|code| format!("start refused with {}", fault(code))),
            self.is_wrong().then(|| format!("angle wrong for {:.2} s", self.wrong_s)),
            self.is_flux_off().then(|| format!("flux off for {:.2} s", self.flux_off_s)),
            self.is_lost().then(|| format!("angle error beyond {LOST_DEG}°")),
            stops.map(fault),
        ];
        let reason = reasons.into_iter().flatten().collect::<Vec<_>>().join(", ");
        if reason.is_empty() {
            return None;
        }
        Some(format!("{}, seed {}: {reason}", self.kind.name(), self.seed))
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
    trial.limit_share = limit_share(config, drive);
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
    let mut still = bring_up(&mut bench, kind.shaft(), config)?;
    if still {
        let taken = follow(&mut bench, purpose, config, &parts)?;
        still = taken.is_some();
        let constant = taken.filter(|_| matches!(kind, Kind::Constant(_)));
        trial.torque_error = constant.map(|i_q| {
            let error = (bench.torque.mean() - torque_nm(config, i_q)) * i_q.signum();
            error / torque_nm(config, nominal_limit_a(config))
        });
    }
    bench.finish(still, &mut trial);
    Ok(trial)
}

/// The torque current that a drive which is off would take, in relation to the nominal limit; none where it says nothing.
fn limit_share<D: DriveUnderTest>(config: &Config, drive: &D) -> Option<f64> {
    let (mut asked, nominal) = (drive.clone(), nominal_limit_a(config));
    asked.start(Purpose::Torque).ok()?;
    let taken = asked.torque(nominal as f32).ok()?;
    Some(f64::from(taken) / nominal)
}

/// Brings a held shaft up to speed without torque; says whether the drive regulated to the end.
fn bring_up<D: DriveUnderTest>(
    bench: &mut Bench<D>,
    shaft: Shaft,
    config: &Config,
) -> Result<bool, Error> {
    let Shaft::Held(rpm) = shaft else { return Ok(true) };
    let speed = config.rpm(rpm) * TAU / 60.0;
    let steps = (rpm.abs() / RAMP_RPM_PER_S / PACE_S).ceil() as u32;
    for n in 1..=steps {
        bench.set_load(Load::Speed { speed: speed * f64::from(n) / f64::from(steps) })?;
        if !bench.watch(PACE_S) {
            return Ok(false);
        }
    }
    Ok(bench.watch(0.3))
}

/// Follows the references. Returns the last one as the drive has taken it, A or rpm; none when it did not regulate to the
/// end.
fn follow<D: DriveUnderTest>(
    bench: &mut Bench<D>,
    purpose: Purpose,
    config: &Config,
    parts: &[Part],
) -> Result<Option<f64>, Error> {
    bench.counted_from = Some(bench.time() + SETTLING_S);
    let mut taken = 0.0;
    for part in parts {
        if purpose == Purpose::Speed {
            bench.set_load(Load::Free { torque: part.load.newton_metres(config) })?;
        }
        if part.turn_deg != 0.0 {
            bench.turn_flux(part.turn_deg);
        }
        let (from, to) = part.reference;
        let steps = if from == to { 1 } else { (part.seconds / PACE_S).round() as u32 };
        for n in 1..=steps {
            let reference = from + (to - from) * f64::from(n) / f64::from(steps);
            let given = match purpose {
                Purpose::Speed => {
                    let rpm = config.rpm(reference) as f32;
                    bench.drive.speed(rpm).map(|()| rpm)
                }
                _ => bench.drive.torque(config.amperes(reference) as f32),
            };
            taken = given.map_err(Error::Refused)?.into();
            if !bench.watch(part.seconds / f64::from(steps)) {
                return Ok(None);
            }
        }
    }
    Ok(Some(taken))
}

#[cfg(test)]
mod tests {
    use drive_core::{Compare, Drive, Sample};

    use super::*;
    use crate::config::plant_settings;

    /// A drive that takes no more than this torque current, A.
    #[derive(Clone)]
    struct Lower(Drive, f32);

    impl DriveUnderTest for Lower {
        fn step(&mut self, sample: &Sample) -> Compare {
            self.0.step(sample)
        }
        fn start(&mut self, purpose: Purpose) -> Result<(), String> {
            DriveUnderTest::start(&mut self.0, purpose)
        }
        fn torque(&mut self, i_q: f32) -> Result<f32, String> {
            DriveUnderTest::torque(&mut self.0, i_q.clamp(-self.1, self.1))
        }
        fn speed(&mut self, rpm: f32) -> Result<(), String> {
            DriveUnderTest::speed(&mut self.0, rpm)
        }
        fn condition(&self) -> Condition {
            self.0.condition()
        }
        fn flux_turns(&self) -> f64 {
            self.0.flux_turns()
        }
    }

    /// A lower limit is seen in every run, and the torque is judged by the command that was taken: with 0.5 A for any
    /// command the error stays that of a sound drive, a few per cent of the torque at the limit.
    #[test]
    fn a_lower_limit_is_seen_and_torque_is_judged_by_what_was_taken() {
        let config = Config::default();
        let drive = Drive::new(config.drive.build().unwrap());
        let of = |limit: f32| {
            let drive = Lower(drive.clone(), limit);
            trial(&config, &plant_settings(&config), &drive, Kind::Constant(0), 5).unwrap()
        };
        let (lower, whole) = (of(0.5), of(10.0));
        assert_eq!((lower.is_limited(), whole.is_limited()), (true, false));
        assert!((lower.limit_share.unwrap() - 0.5 / 3.0).abs() < 1e-6, "{:?}", lower.limit_share);
        for trial in [lower, whole] {
            let error = trial.torque_error.unwrap();
            assert!(error.abs() < 0.04, "{error}");
        }
    }
}
