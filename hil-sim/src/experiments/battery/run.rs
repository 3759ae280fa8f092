//! One run of the stress test.

use super::Learnt;
use crate::experiments::course::{Bench, Course, Kind, Shaft, Trial, allowed_a, nominal_limit_a};
use crate::prelude::*;

/// Longest saliency self-commissioning, s.
const LONGEST_LEARNING_S: f64 = 1000.0;

/// Returns a drive of this configuration, off. If it tracks the saliency, it has run the saliency self-commissioning with
/// the shaft locked, or it refused to with a fault of this number.
///
/// # Errors
/// If settings or plant are refused, or the drive neither learns nor gives a reason.
pub fn learned_drive(config: &Config, seed: u64) -> Result<Learnt, Error> {
    let drive = Drive::new(built(&config.drive)?);
    if !config.drive.tracks_synchronously() {
        return Ok(Ok(drive));
    }
    let mut rig = Bench::new(config, &drive, Shaft::Locked, seed)?.rig;
    rig.command(&Command::Start(Mode::Learning))?;
    match rig.wait_until(LONGEST_LEARNING_S, State::is_off) {
        State::Off => Ok(Ok(rig.drive)),
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
    let Course { shaft, parts } = kind.course(config, &mut seeded(seed));
    let nominal = nominal_limit_a(config);
    let mut bench = Bench::new(config, drive, shaft, seed)?;
    let result = &mut bench.trial;
    result.kind = Some(kind);
    let references = parts.iter().filter_map(|part| part.reference).map(|ramp| ramp.1);
    let drawn = if shaft == Shaft::Free { &mut result.rpm } else { &mut result.i_q };
    *drawn = references.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    result.limit_share = allowed_a(drive, nominal).ok().map(|taken| taken / nominal);
    bench.follow(&parts)?;
    if matches!(kind, Kind::Constant(_)) && !bench.has_ended {
        bench.trial.torque_error = Some(bench.torque_error(bench.taken));
    }
    Ok(bench.finish().0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::course::Change;
    use crate::experiments::course::torque_nm;
    use crate::experiments::disturbed::Asymmetry;

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
            let Course { shaft, mut parts } = kind.course(&config, &mut seeded(seed));
            let dragged = parts[parts.len() - 2];
            let Change::Shaft(rpm) = dragged.change else { panic!("{dragged:?}") };
            let sign = dragged.reference.unwrap().0.signum();
            rates.push((rpm.1 - rpm.0).abs() / dragged.seconds);
            // The long hold is not needed.
            parts.last_mut().unwrap().seconds = 0.5;
            let mut bench = Bench::new(&config, &drive, shaft, seed).unwrap();
            bench.rig.trace = Some(Vec::new());
            bench.follow(&parts[..1]).unwrap();
            let started = bench.rig.time();
            bench.follow(&parts[1..]).unwrap();
            assert!(!bench.has_ended, "{seed}");
            // Frequency of the flux over 0.2 s, Hz, in the direction of the torque.
            let moments = bench.rig.trace.unwrap();
            let torque: Vec<_> = moments.iter().filter(|m| m.t > started + 1.5).collect();
            let hz: Vec<f64> = torque
                .windows(41)
                .map(|m| {
                    let turned = m
                        .windows(2)
                        .map(|two| crate::rig::wrapped_degrees(two[1].phi - two[0].phi) / 360.0);
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
