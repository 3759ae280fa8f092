//! Tests of the ranges of commands, and of small functions of the drive against independent computations.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

use super::*;
use crate::drive::flying_start::Residual;
use crate::drive::standstill_test::next_bit;
use crate::drive::{Regulator, TestSignal};

/// Returns a drive that regulates in this mode, with the encoder.
fn in_mode(mode: Mode) -> Drive {
    let (mut drive, mut load) = (drive(), Load::new());
    drive.command(&Command::Start(mode)).unwrap();
    assert!(run_to(
        &mut drive,
        &mut load,
        if mode == Mode::Torque { State::Torque } else { State::Position }
    ));
    drive
}

fn excitation(amperes: f32, regulator: Regulator, carrier: AlphaBeta) -> Command {
    Command::Test(TestSignal::Current { amperes, regulator, carrier, binary: false })
}

/// Tests each command at the ends of its range, and just beyond.
#[cfg_attr(not(feature = "position"), ignore)]
#[test]
fn the_ends_of_a_range_are_accepted_and_what_lies_beyond_is_refused() {
    let c = settings().build().unwrap();
    let (torque, position) = (in_mode(Mode::Torque), in_mode(Mode::Position));
    let off = Drive::new(c);
    let (turns, press, trip) = (c.motion.position_limit, c.protection.i_q, c.protection.trip_a);
    let volts = c.largest_test_v;
    let least = 0.2 * c.voltage_limit.i_d;
    let regulator = Regulator { k_c: 25.0, z_c: 0.9, direct: 0.0, filtered: false };
    let current = |amperes| excitation(amperes, regulator, AlphaBeta::ZERO);
    let beyond = |x: f32| if x == 0.0 { -1e-6 } else { x * 1.0001 };
    type Make<'a> = &'a dyn Fn(f32) -> Command;
    let cases: [(&Drive, Make, f32, f32); 8] = [
        (&position, &Command::Home, -turns, turns),
        (&position, &|i_q| Command::Press(30.0, i_q), 0.0, press),
        (&torque, &|d| Command::TestVoltage(Dq::new(d, 0.0)), -volts, volts),
        (&torque, &|q| Command::TestVoltage(Dq::new(0.0, q)), -volts, volts),
        (&off, &current, -trip, trip),
        (&torque, &Command::TurnInjection, -f32::MAX, f32::MAX),
        (&torque, &Command::Torque, -f32::MAX, f32::MAX),
        (&position, &Command::Position, -f32::MAX, f32::MAX),
    ];
    for (before, command, min, max) in cases {
        for end in [min, max] {
            let mut drive = before.clone();
            assert!(drive.command(&command(end)).is_ok(), "{:?}", command(end));
            if end.abs() < f32::MAX {
                let mut drive = before.clone();
                let refused = drive.command(&command(beyond(end)));
                assert_eq!(refused, Err(Refused::OutOfRange { min, max }), "{:?}", command(end));
            }
        }
        for number in [f32::NAN, f32::INFINITY, -f32::INFINITY] {
            let mut drive = before.clone();
            let refused = drive.command(&command(number));
            assert!(refused.is_err(), "{:?}", command(number));
            assert_eq!(drive.state(), before.state());
        }
    }
    // A d-axis current below the range is refused; a larger one is limited to the current that the torque leaves.
    let mut drive = torque.clone();
    drive.command(&Command::Torque(2.0)).unwrap();
    let left = (3.5_f32 * 3.5 - 2.0 * 2.0).sqrt();
    assert_eq!(drive.command(&Command::Magnetising(least)), Ok(Accepted::AsGiven));
    assert!(drive.command(&Command::Magnetising(0.999 * least)).is_err());
    let Ok(Accepted::Limited(most)) = drive.command(&Command::Magnetising(9.0)) else { panic!() };
    assert!((most - left).abs() < 1e-5, "{most}, not {left}");
    // A test signal has more numbers that must be finite.
    for bad in [f32::NAN, f32::INFINITY] {
        let none = AlphaBeta::ZERO;
        let bad = [
            excitation(1.0, Regulator { k_c: bad, ..regulator }, none),
            excitation(1.0, Regulator { z_c: bad, ..regulator }, none),
            excitation(1.0, Regulator { direct: bad, ..regulator }, none),
            excitation(1.0, regulator, AlphaBeta::new(bad, 0.0)),
            excitation(1.0, regulator, AlphaBeta::new(0.0, bad)),
            excitation(bad, regulator, none),
        ];
        for command in bad {
            assert_eq!(off.clone().command(&command), Err(Refused::NotFinite), "{command:?}");
        }
    }
}

/// The register of eight bits takes each of its 255 values except zero once, with 128 ones. The sequence is uncorrelated with
/// itself at each of the other 254 shifts.
#[test]
fn the_binary_sequence_has_the_largest_length() {
    let mut register = 0;
    let bits: Vec<f32> = (0..510).map(|_| next_bit(&mut register)).collect();
    assert_eq!(bits[..255], bits[255..]);
    for shift in 1..255 {
        let sum: f32 = (0..255).map(|k| bits[k] * bits[k + shift]).sum();
        assert_eq!(sum, -1.0, "shift {shift}");
    }
    assert_eq!(bits[..255].iter().sum::<f32>(), 1.0);
}

/// The flux of a rotor decays with its time constant. A start waits until the voltage of the flux has decayed, and not if it is
/// small enough.
#[cfg_attr(not(feature = "flying-start"), ignore)]
#[test]
fn a_start_waits_for_the_decay_of_the_flux_and_forgets_it_thereafter() {
    let c = sensorless().build().unwrap();
    let flying_start = c.flying_start.unwrap();
    let per_period = 1.0 / (6000.0 * f64::from(settings().motor.tau_r()));
    for volts in [1.01, 2.0, 5.0, 20.0] {
        let residual = Residual::of(volts * flying_start.residual_v);
        let waits = |elapsed| flying_start.waits(&residual, elapsed);
        let decayed = (f64::from(volts).ln() / per_period) as u32;
        let ends = (0..100_000).find(|elapsed| !waits(*elapsed)).unwrap();
        assert!(
            (decayed..=decayed * 2 + 2).contains(&ends),
            "{volts}: {ends}, decayed at {decayed}"
        );
        assert!(!waits(ends + 100) && (ends == 0 || waits(ends - 1)));
        // It makes no difference whether the time has passed before or after the start.
        let waits = |residual: Residual| flying_start.waits(&residual, 0);
        assert!(!waits(residual.after(ends)) && waits(residual.after(ends - 1)));
    }
    assert!(
        !flying_start.waits(&Residual::of(flying_start.residual_v), 0),
        "as much as is left is no reason to wait"
    );
    let residual = Residual::of(50.0);
    assert!(flying_start.is_recent(&residual.after(flying_start.flux_decay - 1)));
    assert!(!flying_start.is_recent(&residual.after(flying_start.flux_decay)));
    // This is the voltage of a flux of 0.5 V s at 50 Hz.
    let turning = Residual::turning(-50.0 / 6000.0, 0.5);
    let volts = core::f32::consts::TAU * 50.0 * 0.5;
    assert!(flying_start.waits(&turning, 0) && !flying_start.waits(&turning, u32::MAX));
    let same = |n| [Residual::of(volts), turning].map(|flux| flying_start.waits(&flux, n));
    assert!((0..50_000).step_by(500).map(same).all(|[one, other]| one == other));
}

/// Tests NaN in each place where the coefficients are checked.
#[test]
fn coefficients_that_are_no_numbers_are_found() {
    let sound = settings().build().unwrap();
    assert!(sound.is_finite());
    let places: [fn(&mut Coefficients) -> &mut f32; 17] = [
        |c| &mut c.front_end.current_a.gain,
        |c| &mut c.front_end.current_a.offset,
        |c| &mut c.front_end.current_b.gain,
        |c| &mut c.front_end.current_b.offset,
        |c| &mut c.front_end.dc_link.gain,
        |c| &mut c.front_end.dc_link.offset,
        |c| &mut c.current_loop.d.k_c,
        |c| &mut c.current_loop.d.z_c,
        |c| &mut c.current_loop.q.k_c,
        |c| &mut c.current_loop.q.z_c,
        |c| &mut c.injection.current_amplitude,
        |c| &mut c.estimator.lag,
        |c| &mut c.current_lag,
        |c| &mut c.motion.pi.k_c,
        |c| &mut c.motion.speed_limit,
        |c| &mut c.voltage_limit.i_d,
        |c| &mut c.sequence.stop_ramp,
    ];
    for place in places {
        for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY] {
            let mut c = sound;
            *place(&mut c) = bad;
            assert!(!c.is_finite());
        }
    }
}

#[test]
fn goals_that_are_no_numbers_are_found() {
    let Some(_built) = crate::blocks::Position::IN_BUILD else { return };
    let position = |turns, press| Goal::Position { turns, press, _built };
    for bad in [f32::NAN, f32::INFINITY] {
        assert!(!Goal::Speed { speed: bad, jog: 0 }.is_finite());
        assert!(!position(Some(bad), None).is_finite());
        assert!(!position(None, Some((bad, 1.0))).is_finite());
    }
    assert!(Goal::SPEED.is_finite() && position(Some(1.0), Some((1.0, 1.0))).is_finite());
    assert!(Goal::position(_built).is_finite() && Goal::Torque.is_finite());
}

#[test]
fn the_memory_check_covers_the_coefficients() {
    assert_eq!(<Drive>::COEFFICIENTS.len(), size_of::<Coefficients>());
    assert!(<Drive>::COEFFICIENTS.end <= size_of::<Drive>());
    assert!(<Drive>::CHANGES + 4 <= size_of::<Drive>());
}
