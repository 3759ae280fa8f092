//! Tests of the test signals to a motor at rest, with their own sequence and the usual protections.

use super::*;
use crate::drive::{Regulator, TestSignal};
use crate::protect::wiring_check::WiringSettings;

/// Returns the command for a regulated dc current with an injection on top of it.
pub(super) fn current(amperes: f32, carrier: AlphaBeta) -> Command {
    let regulator =
        Regulator { k_c: 25.0, z_c: 1.0 - 167.0 / 6000.0, direct: 0.0, filtered: false };
    Command::Test(TestSignal::Current { amperes, regulator, carrier, binary: false })
}

/// Returns a drive that applies a test signal, and its load.
fn exciting(command: &Command) -> (Drive, Load) {
    let mut drive = Drive::new(settings().build().unwrap());
    let mut load = Load::new();
    assert_eq!(drive.command(command), Ok(Accepted::AsGiven));
    let mut states = vec![drive.state()];
    for _ in 0..2000 {
        period(&mut drive, &mut load);
        if states.last() != Some(&drive.state()) {
            states.push(drive.state());
        }
        if drive.is_testing() {
            assert_eq!(states, [State::Calibrating, State::Precharge, State::Exciting]);
            return (drive, load);
        }
    }
    panic!("{states:?}")
}

fn run(drive: &mut Drive, load: &mut Load, periods: u32, mut seen: impl FnMut(&Drive)) {
    for _ in 0..periods {
        period(drive, load);
        seen(drive);
    }
}

#[test]
fn the_current_along_phase_a_is_the_reference_and_a_carrier_comes_on_top() {
    let (mut drive, mut load) = exciting(&current(1.0, AlphaBeta::ZERO));
    run(&mut drive, &mut load, 1200, |_| {});
    // Steps of the ADC are 2.2 mA.
    assert!((load.current.alpha - 1.0).abs() < 0.005, "{}", load.current.alpha);
    assert!(load.current.beta.abs() < 0.005, "{}", load.current.beta);
    // 50 V at 600 Hz across 51.5 mH and 6.2 ohm make 0.257 A peak, of which nothing is along the
    // axis. The injection rises in 200 periods, so half of it is reached after 100.
    drive.command(&current(1.0, AlphaBeta::new(0.0, 50.0))).unwrap();
    run(&mut drive, &mut load, 95, |_| {});
    let mut half = 0.0_f32;
    run(&mut drive, &mut load, 10, |drive| half = half.max(drive.telemetry().measured.beta));
    assert!((0.11..0.145).contains(&half), "{half}");
    run(&mut drive, &mut load, 500, |_| {});
    let (mut along, mut across) = (0.0_f32, 0.0_f32);
    run(&mut drive, &mut load, 60, |drive| {
        let seen = drive.telemetry();
        along = along.max((seen.measured.alpha - 1.0).abs());
        across = across.max(seen.measured.beta.abs());
    });
    assert!((0.24..0.28).contains(&across) && along < 0.01, "{along} {across}");
}

#[test]
fn a_stop_is_at_once_and_references_are_refused() {
    let (mut drive, mut load) = exciting(&current(2.0, AlphaBeta::ZERO));
    run(&mut drive, &mut load, 600, |_| {});
    for refused in [Command::Torque(0.1), Command::TestVoltage(Dq::ZERO), Command::Relock] {
        assert!(matches!(drive.command(&refused), Err(Refused::State(State::Exciting))));
    }
    let started = drive.command(&Command::Start(Mode::Torque));
    assert_eq!(started, Err(Refused::State(State::Exciting)));
    drive.command(&Command::Stop(Stop::Coast)).unwrap();
    assert_eq!(drive.state(), State::Off);
    assert!(!load.step(&mut drive).enabled);
}

#[test]
fn what_trips_a_drive_trips_an_excitation() {
    type Spoil = fn(&mut Sample);
    let cases: [(Spoil, Fault); 4] = [
        (|s| s.current_a = 4000, Fault::OverCurrentA),
        (|s| s.current_b = 4095, Fault::SensorSaturatedB),
        (|s| s.dc_link = 1000, Fault::DcLinkUnderVoltage),
        (|s| s.hardware = Hardware::BREAK, Fault::Break),
    ];
    for (spoil, fault) in cases {
        let (mut drive, mut load) = exciting(&current(1.0, AlphaBeta::ZERO));
        run(&mut drive, &mut load, 100, |_| {});
        let mut sample = load.sample();
        spoil(&mut sample);
        assert_eq!(load.step_with(&mut drive, &sample), Compare::OFF);
        assert_eq!(drive.state(), State::Fault(fault));
        assert_eq!(drive.command(&current(1.0, AlphaBeta::ZERO)), Err(Refused::Fault(fault)));
    }
}

#[test]
fn an_excitation_beyond_the_trip_or_not_finite_is_refused() {
    let mut drive = Drive::new(settings().build().unwrap());
    let too_much = drive.command(&current(5.0, AlphaBeta::ZERO));
    assert!(matches!(too_much, Err(Refused::OutOfRange { max, .. }) if max < 4.5));
    let nan = current(f32::NAN, AlphaBeta::ZERO);
    assert_eq!(drive.command(&nan), Err(Refused::NotFinite));
    let nan = current(1.0, AlphaBeta::new(0.0, f32::NAN));
    assert_eq!(drive.command(&nan), Err(Refused::NotFinite));
    assert_eq!(drive.state(), State::Off);
}

#[test]
fn a_pulse_train_answers_and_then_rests() {
    // 50 V for two periods are 16.7 mVs, which make 0.32 A in 51.5 mH.
    let pulses =
        WiringSettings { sigma_ls: 0.0515, expected_a: 0.32, noise_a: 0.3, highest_v: 60.0 };
    let mut drive = Drive::new(settings().build().unwrap());
    let mut load = Load::new();
    drive.command(&Command::Test(TestSignal::Pulses(pulses))).unwrap();
    run(&mut drive, &mut load, 1200, |_| {});
    assert_eq!((drive.state(), drive.test_report().trains), (State::Exciting, 1));
    let [a, b, c] = drive.test_report().answers;
    for own in [a[0], b[1], -(c[0] + c[1])] {
        assert!((0.28..0.34).contains(&own), "{own}");
    }
    assert!(load.current.length_squared() < 1e-3);
}
