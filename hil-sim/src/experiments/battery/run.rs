//! One run of the stress test.

use super::bench::Bench;
use super::kind::{Kind, Part, Shaft, allowed_a, nominal_limit_a, share_of_limit};
use super::trial::Trial;
use crate::prelude::*;

/// Time after the first reference that the statistics of the error exclude, s: the angle settles.
const SETTLING_S: f64 = 0.5;
/// Step time of a reference that changes gradually, s.
const PACE_S: f64 = 0.01;
/// Acceleration of the dynamometer, rpm/s.
const RAMP_RPM_PER_S: f64 = 600.0;
/// Longest saliency self-commissioning, s.
const LONGEST_LEARNING_S: f64 = 1000.0;

/// Runs the saliency self-commissioning of a drive with the shaft locked; returns the drive, off, or the number of the
/// fault with which it refused.
///
/// # Errors
/// If the plant is refused, or the drive neither learns nor gives a reason.
pub fn learned(config: &Config, drive: Drive, seed: u64) -> Result<Result<Drive, u8>, Error> {
    let mut bench = Bench::new(config, &drive, Load::Locked, seed)?;
    bench.rig.command(&Command::Start(Mode::Learning))?;
    match bench.wait(LONGEST_LEARNING_S) {
        State::Off => Ok(Ok(bench.rig.drive)),
        State::Fault(fault) => Ok(Err(fault.code())),
        other => Err(Error::Internal(format!(
            "after {LONGEST_LEARNING_S} s of learning the drive is {other}"
        ))),
    }
}

/// Does one run with a copy of a drive that is off. The configuration scales currents, speeds and torques.
///
/// # Errors
/// If the plant is refused, or the drive refuses a command.
pub fn trial(config: &Config, drive: &Drive, kind: Kind, seed: u64) -> Result<Trial, Error> {
    let mut random = seeded(seed);
    let parts = kind.parts(&mut random);
    let nominal = nominal_limit_a(config);
    let (load, mode) = kind.shaft().at_rest();
    let mut bench = Bench::new(config, drive, load, seed)?;
    bench.trial.kind = Some(kind);
    let references = parts.iter().map(|part| part.reference.1);
    let drawn = if mode == Mode::Speed { &mut bench.trial.rpm } else { &mut bench.trial.i_q };
    *drawn = references.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    bench.trial.limit_share = allowed_a(drive, nominal).ok().map(|taken| taken / nominal);
    if let Err(refused) = bench.start(mode) {
        bench.trial.refused = Some(refused);
        return Ok(bench.finish(true).0);
    }
    let mut still = bring_up(&mut bench, kind.shaft(), config)?;
    if still {
        bench.counted_from = Some(bench.time() + SETTLING_S);
        let taken = follow(&mut bench, config, &parts)?;
        still = taken.is_some();
        let constant = taken.filter(|_| matches!(kind, Kind::Constant(_)));
        bench.trial.torque_error = constant.map(|i_q| bench.torque_error(config, i_q));
    }
    Ok(bench.finish(still).0)
}

/// Makes a bench whose drive regulates torque while a dynamometer holds this speed, rpm; none if the drive did not reach that state.
///
/// # Errors
/// If the plant is refused.
pub fn held(config: &Config, drive: &Drive, rpm: f64, seed: u64) -> Result<Option<Bench>, Error> {
    let shaft = Shaft::Held(rpm);
    let (load, mode) = shaft.at_rest();
    let mut bench = Bench::new(config, drive, load, seed)?;
    let regulates = bench.start(mode).is_ok() && bring_up(&mut bench, shaft, config)?;
    Ok(regulates.then_some(bench))
}

/// Brings a held shaft up to speed without torque; returns whether the drive regulated to the end.
///
/// # Errors
/// If the plant is refused.
pub fn bring_up(bench: &mut Bench, shaft: Shaft, config: &Config) -> Result<bool, Error> {
    let Shaft::Held(rpm) = shaft else { return Ok(true) };
    let speed = config.rpm(rpm) * TAU / 60.0;
    let steps = (rpm.abs() / RAMP_RPM_PER_S / PACE_S).ceil() as u32;
    for n in 1..=steps {
        bench.rig.set_load(Load::Speed { speed: speed * f64::from(n) / f64::from(steps) })?;
        if !bench.watch(PACE_S) {
            return Ok(false);
        }
    }
    Ok(bench.watch(0.3))
}

/// Follows the references. Returns the last reference as the drive accepted it, A or rpm; none if it did not regulate
/// to the end.
///
/// # Errors
/// If the plant is refused, or the drive refuses a reference.
pub fn follow(bench: &mut Bench, config: &Config, parts: &[Part]) -> Result<Option<f64>, Error> {
    let mut taken = 0.0;
    for part in parts {
        if bench.mode == Mode::Speed {
            bench.rig.set_load(Load::Free { torque: part.load.newton_metres(config) })?;
        }
        if part.turn_deg != 0.0 {
            bench.turn_flux(part.turn_deg);
        }
        let changes = part.reference.0 != part.reference.1 || part.shaft_rpm.is_some();
        let steps = if changes { (part.seconds / PACE_S).round() as u32 } else { 1 };
        for n in 1..=steps {
            let between =
                |(from, to): (f64, f64)| from + (to - from) * f64::from(n) / f64::from(steps);
            let reference = between(part.reference);
            if let Some(rpm) = part.shaft_rpm.map(between) {
                bench.rig.set_load(Load::Speed { speed: config.rpm(rpm) * TAU / 60.0 })?;
            }
            taken = match bench.mode {
                Mode::Speed => {
                    let rpm = config.rpm(reference) as f32;
                    bench.rig.command(&Command::Speed(rpm))?;
                    rpm
                }
                _ => bench.torque(share_of_limit(config, reference) as f32)?,
            }
            .into();
            if !bench.watch(part.seconds / f64::from(steps)) {
                return Ok(None);
            }
        }
    }
    Ok(Some(taken))
}

#[cfg(test)]
mod tests {
    use super::super::disturbed::Asymmetry;
    use super::super::kind::torque_nm;
    use super::*;

    /// A lower limit is visible in every run, and the torque is judged by the accepted command. With 0.5 A for any
    /// command the error stays that of a healthy drive, a few per cent of the torque at the limit.
    #[test]
    fn a_lower_limit_is_seen_and_torque_is_judged_by_what_was_taken() {
        let config = Config::default();
        let of = |limit: Option<f32>| {
            let mut settings = config.drive;
            // With the 0.7 A of the flux this leaves 0.5 A.
            (settings.limits.current_a, settings.limits.inverter_a) = (limit, Some(3.5));
            settings.braking.flux_a = Some(0.0);
            if limit.is_some() {
                // The tables of the injection hold for the usual limit.
                settings.angle_source = drive_core::AngleSource::Encoder;
            }
            let drive = Drive::new(settings.build().unwrap());
            trial(&config, &drive, Kind::Constant(0), 5).unwrap()
        };
        let (lower, whole) = (of(Some(0.74_f32.sqrt())), of(None));
        assert_eq!((lower.is_limited(), whole.is_limited()), (true, false));
        assert!((lower.limit_share.unwrap() - 0.5 / 3.0).abs() < 1e-6, "{:?}", lower.limit_share);
        for trial in [lower, whole] {
            let error = trial.torque_error.unwrap();
            assert!(error.abs() < 0.04, "{error}");
        }
    }

    /// A driven shaft takes the rotor flux of the motor through zero frequency while the torque brakes or drives. The
    /// flux angle of the plant rotates one way before and the other way after. In between, the torque is that of 2.25 A
    /// or more with the 0.7 A of the flux, 3/2 P L_m^2/L_r i_d i_q. Covers into and out of generating, at 5 to 300
    /// rpm/s.
    #[test]
    fn a_dragged_shaft_takes_the_flux_through_zero_frequency_under_torque() {
        let config = Config::default();
        let drive = Drive::new(config.drive.build().unwrap());
        let (mut into, mut out_of, mut rates) = (0, 0, Vec::new());
        for seed in 0..12 {
            let kind = Kind::Dragged(Asymmetry::None);
            let mut parts = kind.parts(&mut seeded(seed));
            let dragged = parts.iter().rev().find(|part| part.shaft_rpm.is_some()).unwrap();
            let (rpm, sign) = (dragged.shaft_rpm.unwrap(), dragged.reference.0.signum());
            rates.push((rpm.1 - rpm.0).abs() / dragged.seconds);
            // The long hold is not needed.
            parts.last_mut().unwrap().seconds = 0.5;
            let load = Load::Speed { speed: 0.0 };
            let mut bench = Bench::new(&config, &drive, load, seed).unwrap();
            bench.trace = Some(Vec::new());
            bench.start(Mode::Torque).unwrap();
            let started = bench.time();
            assert!(follow(&mut bench, &config, &parts).unwrap().is_some(), "{seed}");
            // Frequency of the flux over 0.2 s, Hz, in the direction of the torque.
            let moments = bench.trace.unwrap();
            let torque: Vec<_> = moments.iter().filter(|m| m.t > started + 1.5).collect();
            let hz: Vec<f64> = torque
                .windows(41)
                .map(|m| {
                    let turned = m.windows(2).map(|two| {
                        let change = two[1].flux.arg() - two[0].flux.arg();
                        crate::rig::wrapped_degrees(change) / 360.0
                    });
                    sign * turned.sum::<f64>() / (m[40].t - m[0].t)
                })
                .collect();
            let (first, last) = (hz[0], hz[hz.len() - 1]);
            assert!(first * last < 0.0 && first.abs().min(last.abs()) > 1.0, "{first} {last} Hz");
            if last < 0.0 {
                into += 1
            } else {
                out_of += 1
            }
            let crossing = hz.iter().position(|hz| hz * first <= 0.0).unwrap();
            let nm = sign * torque[crossing + 20].torque;
            assert!(nm > 0.9 * torque_nm(&config, 2.25), "{seed}: {nm} Nm");
        }
        assert!(into >= 3 && out_of >= 3, "{into} into, {out_of} out of generating");
        let (least, most) = (
            rates.iter().copied().fold(f64::MAX, f64::min),
            rates.iter().copied().fold(0.0, f64::max),
        );
        assert!((5.0..15.0).contains(&least) && most > 100.0 && most <= 300.0, "{rates:?}");
    }
}
