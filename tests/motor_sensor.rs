//! Procedure: the temperature sensor of the motor, at rest, at speed and off.

use crate::common::config;
use drive_core::{Command, Fault, Limiting, Mode, Refused, State, Stop};
use drive_settings::SensorKind;
use hil_sim::Config;
use hil_sim::rig::Rig;

/// With a sensor, derating from 120 °C, trip at 140 °C.
fn sensed() -> Config {
    let mut config = config(&["angle_source=encoder", "load.mode=free", "speed.limit_rpm=1000"]);
    config.drive.motor_sensor.sensor = SensorKind::Pt1000;
    config
}

/// Ten readings a second, for a second.
fn read(rig: &mut Rig, reading: Result<f32, Fault>) {
    for _ in 0..10 {
        rig.command(&Command::MotorTemperature(reading)).unwrap();
        rig.wait(0.1);
    }
}

const WRONG: [(Result<f32, Fault>, Fault); 4] = [
    (Err(Fault::MotorSensorOpen), Fault::MotorSensorOpen),
    (Err(Fault::MotorSensorShorted), Fault::MotorSensorShorted),
    (Ok(140.0), Fault::MotorHot),
    (Ok(f32::NAN), Fault::MotorHot),
];

/// A start needs a reading, and one without a fault; after settings are put in force a new reading is needed. Without a sensor nothing is
/// read.
#[test]
fn a_start_is_refused_without_a_sound_reading() {
    let mut rig = Rig::from_config(&sensed(), 1).unwrap();
    for mode in [Mode::Torque, Mode::VoltsPerHertz, Mode::Commissioning] {
        let start = Command::Start(mode);
        let refused = |fault| Err(Refused::Stands(fault));
        let coefficients = sensed().drive.build().unwrap();
        rig.drive.command(&Command::Configure(coefficients)).unwrap();
        assert_eq!(rig.drive.command(&start), refused(Fault::MotorSensorUnread));
        for (reading, fault) in WRONG {
            read(&mut rig, reading);
            assert_eq!(
                (rig.drive.state(), rig.drive.command(&start)),
                (State::Off, refused(fault))
            );
        }
    }
    read(&mut rig, Ok(25.0));
    rig.start(Mode::Torque).unwrap();

    let mut rig = Rig::from_config(&config(&["angle_source=encoder"]), 1).unwrap();
    read(&mut rig, Err(Fault::MotorSensorOpen));
    rig.start(Mode::Torque).unwrap();
    read(&mut rig, Ok(300.0));
    assert_eq!(rig.drive.state(), State::Torque);
}

/// A defective sensor and a hot motor switch off within a period, at rest and at speed, in regulated modes and with V/f control; a start
/// is refused after a clear.
#[test]
fn a_defect_switches_off() {
    for (mode, rpm) in [
        (Mode::Speed, 0.0),
        (Mode::Speed, 900.0),
        (Mode::VoltsPerHertz, 0.0),
        (Mode::VoltsPerHertz, 600.0),
    ] {
        let mut rig = Rig::from_config(&sensed(), 2).unwrap();
        read(&mut rig, Ok(60.0));
        rig.start(mode).unwrap();
        rig.wait(1.5);
        rig.command(&Command::Speed(rpm)).unwrap();
        rig.wait(4.0);
        let found = rig.plant.mechanical_speed() * 9.549;
        assert!(
            (found - f64::from(rpm)).abs() < 20.0,
            "{mode:?} {rpm}: {found}, {}",
            rig.drive.state()
        );
        for (reading, fault) in WRONG {
            let mut rig = rig.clone();
            rig.command(&Command::MotorTemperature(reading)).unwrap();
            assert_eq!(rig.drive.state(), State::Fault(fault), "{mode:?} {rpm}");
            rig.wait(1.0);
            assert!(rig.plant.current().norm() < 1e-3, "{}", rig.plant.current().norm());
            // A good reading does not remove a latched fault.
            rig.command(&Command::MotorTemperature(Ok(60.0))).unwrap();
            assert_eq!(rig.drive.state(), State::Fault(fault));
            read(&mut rig, reading);
            rig.command(&Command::Clear).unwrap();
            assert_eq!(rig.drive.command(&Command::Start(mode)), Err(Refused::Stands(fault)));
        }
    }
}

/// From 120 to 140 °C the square of the current decreases linearly: at 130 °C the vector is 0.71 of the limit.
#[test]
fn the_torque_falls_with_the_temperature() {
    let mut rig = Rig::from_config(&sensed(), 3).unwrap();
    rig.set_load(hil_sim::plant::Load::Locked).unwrap();
    read(&mut rig, Ok(25.0));
    rig.start(Mode::Torque).unwrap();
    rig.command(&Command::Torque(3.4)).unwrap();
    for (celsius, share) in
        [(119.0_f32, 1.0_f32), (125.0, 0.75), (130.0, 0.5), (135.0, 0.25), (139.5, 0.025)]
    {
        read(&mut rig, Ok(celsius));
        let (current, limit) = (rig.drive.telemetry().reference, 3.5 * share.sqrt());
        let i_q = (limit * limit - 0.49).max(0.0).sqrt().min(3.4);
        assert!((current.q - i_q).abs() < 0.02, "{celsius}: {} of {i_q}", current.q);
        let why = if share < 1.0 { Limiting::Motor } else { Limiting::None };
        assert_eq!((rig.drive.state(), rig.drive.limiting()), (State::Torque, why), "{celsius}");
    }
    // Settings without a sensor remove the limit.
    rig.command(&Command::Stop(Stop::Coast)).unwrap();
    rig.wait(1.0);
    let mut without = sensed();
    without.drive.motor_sensor.sensor = SensorKind::None;
    rig.command(&Command::Configure(without.drive.build().unwrap())).unwrap();
    rig.start(Mode::Torque).unwrap();
    rig.command(&Command::Torque(3.4)).unwrap();
    rig.wait(1.0);
    assert_eq!((rig.drive.state(), rig.drive.limiting()), (State::Torque, Limiting::None));
}
