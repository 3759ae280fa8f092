//! One run of the battery.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

use super::bench::Bench;
use super::drive::{Condition, DriveUnderTest, Purpose};
use super::kind::{Kind, Part, Shaft, nominal_limit_a, torque_nm};
use super::trial::Trial;
use crate::config::Config;
use crate::error::Error;
use crate::plant::{Load, PlantSettings};

/// Time after the first reference that the statistics of the error leave out, s: the angle settles.
const SETTLING_S: f64 = 0.5;
/// Pace of a reference that changes gradually, s.
const PACE_S: f64 = 0.01;
/// How fast the dynamometer gets up to speed, rpm/s.
const RAMP_RPM_PER_S: f64 = 600.0;
/// Longest start and longest learning, s.
pub const LONGEST_START_S: f64 = 30.0;
const LONGEST_LEARNING_S: f64 = 1000.0;
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
        bench.counted_from = Some(bench.time() + SETTLING_S);
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
///
/// # Errors
/// When the plant is refused.
pub fn bring_up<D: DriveUnderTest>(
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
///
/// # Errors
/// When the plant is refused, or the drive refuses a reference.
pub fn follow<D: DriveUnderTest>(
    bench: &mut Bench<D>,
    purpose: Purpose,
    config: &Config,
    parts: &[Part],
) -> Result<Option<f64>, Error> {
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
