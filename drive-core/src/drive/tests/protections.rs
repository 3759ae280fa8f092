//! Tests of the protections of a running drive.

use super::*;
use crate::dc_link::Limiting;
use crate::settings::CurrentSensors;

#[test]
fn every_protection_switches_off_in_the_same_step() {
    type Change = fn(&mut Sample);
    let cases: [(Change, Fault); 15] = [
        (|s| s.current_a = 4050, Fault::OverCurrentA),
        (|s| s.current_b = 4050, Fault::OverCurrentB),
        (|s| (s.current_a, s.current_b) = (3200, 3300), Fault::OverCurrentC),
        (|s| s.current_a = 4095, Fault::SensorSaturatedA),
        (|s| s.current_b = 0, Fault::SensorSaturatedB),
        (|s| s.dc_link = 3700, Fault::DcLinkOverVoltage),
        (|s| s.dc_link = 1000, Fault::DcLinkUnderVoltage),
        (|s| s.heat_sink = 3400, Fault::OverTemperature),
        (|s| s.heat_sink = 0, Fault::ThermistorOpen),
        (|s| s.heat_sink = 4095, Fault::ThermistorShorted),
        (|s| s.encoder = 1_000_000, Fault::Encoder),
        (|s| s.hardware = Hardware::BREAK, Fault::Break),
        (|s| s.hardware = Hardware::ANALOG_WATCHDOG, Fault::AnalogWatchdog),
        (|s| s.hardware = Hardware::DEADLINE_MISS, Fault::DeadlineMiss),
        (|s| s.hardware = Hardware::CONVERTER_OVERRUN, Fault::ConverterOverrun),
    ];
    for (change, fault) in cases {
        let (mut drive, mut load) = running();
        let mut sample = load.sample();
        change(&mut sample);
        assert_eq!(load.step_with(&mut drive, &sample), Compare::OFF, "{fault}");
        assert_eq!(drive.state(), State::Fault(fault));
        // The fault stays latched and names itself, and after a clear and a start the drive runs again.
        assert_eq!(load.step(&mut drive), Compare::OFF);
        assert_eq!(drive.command(&Command::Start(Mode::Torque)), Err(Refused::Fault(fault)));
        drive.command(&Command::Clear).unwrap();
        load = Load::new();
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque), "after {fault}");
    }
}

#[test]
fn a_chopper_that_is_off_is_a_fault_where_there_is_a_resistor() {
    for ohm in [0.0, 100.0] {
        let mut settings = settings();
        settings.braking.ohm = ohm;
        let (mut drive, mut load) = (Drive::new(settings.build().unwrap()), Load::new());
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque));
        let sample = Sample { hardware: Hardware::CHOPPER_OFF, ..load.sample() };
        let compare = load.step_with(&mut drive, &sample);
        assert_eq!(compare.enabled, ohm == 0.0);
        let fault = State::Fault(Fault::ChopperOff);
        assert_eq!(drive.state(), if ohm > 0.0 { fault } else { State::Torque });
    }
}

#[test]
fn over_speed_trips() {
    // This load has no back-EMF, so the check that would miss it is disabled.
    let mut settings = settings();
    settings.limits.unexplained_v = Some(1000.0);
    let (mut drive, mut load) = (Drive::new(settings.build().unwrap()), Load::new());
    drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert!(run_to(&mut drive, &mut load, State::Torque));
    let mut sample = load.sample();
    for _ in 0..3000 {
        // 70 counts per period are 2520 rpm.
        sample.encoder = sample.encoder.wrapping_add(70);
        let now = load.sample();
        sample = Sample { encoder: sample.encoder, ..now };
        let compare = load.step_with(&mut drive, &sample);
        load.advance(compare);
    }
    assert_eq!(drive.state(), State::Fault(Fault::OverSpeed));
}

#[test]
fn a_stuck_current_sensor_is_found_before_the_current_runs_away() {
    let (mut drive, mut load) = running();
    let stuck = load.sample();
    drive.command(&Command::Torque(1.0)).unwrap();
    let mut largest = 0.0_f32;
    for _ in 0..3000 {
        let sample = Sample { current_a: stuck.current_a, ..load.sample() };
        let compare = load.step_with(&mut drive, &sample);
        load.advance(compare);
        largest = largest.max(load.current.length_squared());
        if matches!(drive.state(), State::Fault(_)) {
            break;
        }
    }
    assert_eq!(drive.state(), State::Fault(Fault::CurrentNotAsPredicted));
    assert!(largest < 4.47_f32 * 4.47, "{largest}");
}

#[test]
fn a_silent_channel_is_found_by_its_carrier() {
    for (channel, fault) in [(0, Fault::CarrierMissingA), (1, Fault::CarrierMissingB)] {
        let mut settings = settings();
        settings.injection.beside_encoder = true;
        // The other check is disabled.
        settings.limits.unexplained_v = Some(1000.0);
        let (mut drive, mut load) = (Drive::new(settings.build().unwrap()), Load::new());
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque));
        // The injection is at 60°: 0.5 along phase a, 0.5 along phase b.
        drive.command(&Command::TurnInjection(-30.0)).unwrap();
        let zero = Load::new().sample();
        let mut periods = 0;
        while drive.state() == State::Torque && periods < 600 {
            let mut sample = load.sample();
            if channel == 0 && periods > 100 {
                sample.current_a = zero.current_a;
            } else if channel == 1 && periods > 100 {
                sample.current_b = zero.current_b;
            }
            let compare = load.step_with(&mut drive, &sample);
            load.advance(compare);
            periods += 1;
        }
        assert_eq!(drive.state(), State::Fault(fault), "channel {channel}");
        // Detection takes three injection periods, and up to one more to the end of the present one.
        assert!((120..=150).contains(&periods), "{periods}");
    }
}

#[test]
fn an_open_phase_does_not_get_past_the_start() {
    // If a is open, the current is across phase a; if b or c is open, it is along the other two in series; if all are open, there
    // is none.
    let axis = |degrees: f32| Some(Angle::from_degrees(degrees).unit_vector());
    let nothing = Some(UnitVector { cos: 0.0, sin: 0.0 });
    for (name, only) in [("a", axis(90.0)), ("b", axis(30.0)), ("c", axis(-30.0)), ("all", nothing)]
    {
        let mut drive = Drive::new(sensorless().build().unwrap());
        let mut load = Load { only, ..Load::new() };
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(!run_to(&mut drive, &mut load, State::Torque), "{name}");
        let State::Fault(fault) = drive.state() else { panic!("{name}: {}", drive.state()) };
        let named = [
            Fault::CarrierMissingA,
            Fault::CarrierMissingB,
            Fault::CarrierWeak,
            Fault::CarrierNoRoom,
            Fault::CurrentNotAsPredicted,
        ];
        assert!(named.contains(&fault), "{name}: {fault:?}");
    }
}

#[test]
fn a_carrier_without_room_is_made_smaller_visibly_or_refused() {
    // 206 V allow 119 V in every direction, so 100 V of injection fit beside a small fundamental, and 150 V never fit.
    for (amplitude, shares) in [(100.0, (0.8, 0.99)), (150.0, (0.5, 0.7))] {
        let mut settings = settings();
        settings.injection.beside_encoder = true;
        settings.injection.amplitude_v = Some(amplitude);
        let (mut drive, mut load) = (Drive::new(settings.build().unwrap()), Load::new());
        load.v_dc = 206.0;
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        assert!(run_to(&mut drive, &mut load, State::Torque));
        // 6.2 ohm times 3.2 A are 20 V of fundamental.
        drive.command(&Command::Torque(3.1)).unwrap();
        let mut current = 0.0;
        for _ in 0..1200 {
            period(&mut drive, &mut load);
            current = drive.telemetry().current.q;
        }
        let share = drive.telemetry().carrier_share;
        assert_eq!(drive.state(), State::Torque);
        assert!(share > shares.0 && share < shares.1, "{amplitude} V: {share}");
        assert!((current - 3.1).abs() < 0.05, "{current}");
        // The full injection returns when there is enough voltage.
        load.v_dc = 311.0;
        (0..1200).for_each(|_| period(&mut drive, &mut load));
        assert_eq!(drive.telemetry().carrier_share, 1.0);
    }
    let mut settings = settings();
    settings.injection.beside_encoder = true;
    settings.injection.amplitude_v = Some(150.0);
    settings.limits.dc_under_v = Some(50.0);
    let (mut drive, mut load) = (Drive::new(settings.build().unwrap()), Load::new());
    load.v_dc = 120.0; // 69 V
    drive.command(&Command::Start(Mode::Torque)).unwrap();
    assert!(!run_to(&mut drive, &mut load, State::Torque));
    assert_eq!(drive.state(), State::Fault(Fault::CarrierNoRoom));
}

/// Half-way between the limits of the heat sink, half of 3.5 A is left: 1.6 A beside 0.7 A of d-axis current. The current
/// rises again as the heat sink cools.
#[test]
fn a_hot_heat_sink_takes_torque_current_before_it_trips() {
    let (mut drive, mut load) = running();
    drive.command(&Command::Torque(3.0)).unwrap();
    let mut at = |drive: &mut Drive, celsius: f32| {
        for _ in 0..1200 {
            let heat_sink = Settings::default().scales.ntc.code(celsius);
            let sample = Sample { heat_sink, ..load.sample() };
            let compare = load.step_with(drive, &sample);
            load.advance(compare);
        }
        (drive.telemetry().current.q, drive.limiting())
    };
    let (whole, why) = at(&mut drive, 60.0);
    assert!((whole - 3.0).abs() < 0.02 && why == Limiting::None, "{whole} {why}");
    let (half, why) = at(&mut drive, 77.5);
    // The tolerance is 4 % of 3.5 A for the curve of the thermistor, multiplied by i/i_q for i_q.
    assert!((half - libm::sqrtf(1.75 * 1.75 - 0.7 * 0.7)).abs() < 0.16, "{half}");
    assert_eq!(why, Limiting::HeatSink);
    let (nothing, why) = at(&mut drive, 84.9);
    assert!(nothing.abs() < 0.02 && why == Limiting::HeatSink, "{nothing} {why}");
    let (whole, why) = at(&mut drive, 60.0);
    assert!((whole - 3.0).abs() < 0.02 && why == Limiting::None, "{whole} {why}");
}

/// In each phase of the drive the load of the motor approaches the square of the current vector relative to its continuous current,
/// with its time constant. Without outputs the load decays.
#[cfg_attr(not(feature = "vf"), ignore)]
#[test]
fn the_load_of_the_motor_follows_the_current_in_every_phase() {
    let mut s = settings();
    (s.limits.motor_s, s.limits.motor_a) = (10.0, Some(2.0));
    let c = s.build().unwrap();
    let excite = standstill_test::current(1.5, AlphaBeta::ZERO);
    // The last column is the least square of the current, A^2.
    let cases: [(Option<Command>, State, f32); 5] = [
        (None, State::Off, 0.0),
        (Some(Command::Start(Mode::Torque)), State::Calibrating, 0.0),
        (Some(excite), State::Exciting, 2.2),
        (Some(Command::Start(Mode::Torque)), State::Torque, 0.4),
        (Some(Command::Start(Mode::VoltsPerHertz)), State::VoltsPerHertz, 0.1),
    ];
    for (command, state, least) in cases {
        let (mut drive, mut load) = (Drive::new(c), Load::new());
        if let Some(command) = command {
            drive.command(&command).unwrap();
        }
        assert!(run_to(&mut drive, &mut load, state), "{state:?}");
        if least > 0.0 {
            (0..3000).for_each(|_| period(&mut drive, &mut load));
        }
        drive.kept.thermal.motor = 0.5;
        // The time is shorter than the calibration of a start.
        let periods = 3 * crate::protect::Thermal::EVERY;
        let mut squares = 0.0;
        for _ in 0..periods {
            period(&mut drive, &mut load);
            squares += load.current.length_squared();
        }
        assert_eq!(drive.state(), state);
        let square = squares / periods as f32;
        assert!(square >= least, "{state:?}: {square}");
        let goes_to = if least > 0.0 { square / 4.0 } else { 0.0 };
        let expected = 0.5 + (goes_to - 0.5) * (periods as f32 / 6000.0 / 10.0);
        let found = drive.kept.thermal.motor;
        let error = (found - expected).abs() / (0.5 - expected).abs();
        assert!(error < 0.05, "{state:?}: {found}, not {expected}; {square} A^2");
    }
}

/// With a relay the drive starts only after the link has been steady, and not below the trip voltage.
#[test]
fn a_link_that_is_not_charged_refuses_a_start() {
    let mut s = settings();
    s.supply.relay_s = 0.1;
    let (mut drive, mut load) = (Drive::new(s.build().unwrap()), Load::new());
    let start = Command::Start(Mode::Torque);
    for _ in 0..600 {
        assert_eq!(drive.command(&start), Err(Refused::NotCharged));
        load.step(&mut drive);
    }
    load.step(&mut drive);
    assert_eq!(drive.clone().command(&start), Ok(Accepted::AsGiven));
    load.v_dc = 100.0;
    load.step(&mut drive);
    assert_eq!(drive.command(&start), Err(Refused::NotCharged));
}

/// The offset of the shunt amplifiers changes when the low sides are switched on: 0.3 A are within the 0.4 A of the first
/// measurement, and beyond half of it.
#[test]
fn an_offset_that_comes_with_the_low_sides_is_found_behind_shunts() {
    let start = |amperes: f32, sensors| {
        let mut s = settings();
        s.scales.sensors = sensors;
        let c = s.build().unwrap();
        let (mut drive, mut load) = (Drive::new(c), Load::new());
        drive.command(&Command::Start(Mode::Torque)).unwrap();
        for _ in 0..6000 {
            let i = load.current.to_abc();
            let moved = if drive.state() == State::Calibrating { 0.0 } else { amperes };
            let code = |line: Line, i: f32| ((i - line.offset) / line.gain) as u16;
            let sample = Sample {
                current_a: code(s.scales.current_a, i.a + moved),
                current_c: code(s.scales.current_c, i.c),
                ..load.sample()
            };
            let compare = load.step_with(&mut drive, &sample);
            load.advance(compare);
            if !matches!(drive.state(), State::Calibrating | State::Precharge) {
                break;
            }
        }
        drive.state()
    };
    let largest = settings().build().unwrap().offsets.largest;
    let (found, passes) = (State::Fault(Fault::OffsetA), State::Magnetising);
    for (share, sensors, state) in [
        (0.6, CurrentSensors::LowSide, found),
        (-0.6, CurrentSensors::LowSide, found),
        (0.4, CurrentSensors::LowSide, passes),
        (0.6, CurrentSensors::InLine, passes),
    ] {
        assert_eq!(start(share * largest, sensors), state, "{share} of the limit, {sensors:?}");
    }
}
