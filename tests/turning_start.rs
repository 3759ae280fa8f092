//! Procedure: flying start at low speed, where the injection gives the angle.

use crate::common::{angle_error, coast};
use drive_core::{Command, Fault, Mode, State};
use hil_sim::Config;
use hil_sim::experiments::full_range::for_the_range;
use hil_sim::rig::Rig;

/// The search for the speed and the build-up of the flux do not change the tracked stator resistance, with and without flux that remains
/// after a stop. (They once did by up to 40 %.)
#[test]
fn a_start_on_a_turning_shaft_keeps_the_resistance() {
    let mut refused = 0;
    for (seed, rpm, torque) in [(1, 85.0, -2.2), (2, -60.0, 2.2), (3, 140.0, 1.0), (4, 85.0, 2.2)] {
        let mut config = for_the_range(&Config::default()).unwrap();
        config.prepare.learn = true;
        let mut rig = Rig::from_config(&config, seed).unwrap();
        rig.turn(0.0).unwrap();
        rig.start(Mode::Torque).unwrap();
        rig.bring_to(rpm, 20, 0.01).unwrap();
        rig.command(&Command::Torque(torque)).unwrap();
        rig.wait(0.5);
        assert_eq!(rig.drive.state(), State::Torque, "{rpm} rpm, {torque} A");
        let before = rig.drive.stator_resistance().unwrap();
        coast(&mut rig);
        let stopped = rig;
        for pause in [0.05, 0.15, 0.25, 0.37, 1.5] {
            let mut rig = stopped.clone();
            rig.wait(pause);
            // The residual flux and the flux of the search can cancel. Then the drive takes the shaft to be at rest, and the saliency
            // check refuses the start.
            if rig.start(Mode::Torque).is_err() {
                refused += 1;
                assert_eq!(rig.drive.state(), State::Fault(Fault::NoSaliency));
                rig.command(&Command::Clear).unwrap();
                rig.start(Mode::Torque).unwrap();
            }
            rig.wait(0.01);
            let (state, more) = (rig.drive.state(), rig.drive.stator_resistance().unwrap());
            assert_eq!(state, State::Torque);
            // The filter begins with a deviation of 30 %: noise of the first injection periods moves it by up to 3.8 % here.
            assert!((more - before).abs() < 0.06, "{more}");
        }
    }
    assert!(refused <= 1, "{refused}");
}

/// With saturation, the injection current changes with the flux that builds up. The lock monitor begins to measure its baseline 0.2 s
/// later, and does not stop a drive whose angle is right.
#[test]
fn on_iron_a_start_on_a_turning_shaft_is_not_taken_for_a_lost_lock() {
    for (seed, plant, rpm, torque) in
        [(1, "r", 60.0, 2.0), (2, "r", -110.0, -1.6), (3, "m4b", 200.0, 1.5)]
    {
        let mut config = Config::load(None, None, &[format!("plant={plant}")]).unwrap();
        config = for_the_range(&config).unwrap();
        config.prepare.learn = true;
        let mut rig = Rig::from_config(&config, seed).unwrap();
        rig.turn(rpm).unwrap();
        rig.start(Mode::Torque).unwrap();
        rig.command(&Command::Torque(torque)).unwrap();
        rig.wait(0.5);
        let largest = angle_error(&mut rig, 1.5).largest();
        assert_eq!(rig.drive.state(), State::Torque);
        assert!(largest < 15.0, "{largest}");
    }
}

/// Above 2700 rpm the noise of the sensors hides the voltage of the rotor: the drive refuses the start in either direction, and no
/// current remains.
#[test]
fn a_shaft_that_turns_too_fast_is_refused() {
    for (seed, rpm, caught) in
        [(1, 3300.0, false), (2, -3300.0, false), (3, 2500.0, true), (4, -2500.0, true)]
    {
        let mut config = for_the_range(&Config::default()).unwrap();
        config.prepare.learn = true;
        let mut rig = Rig::from_config(&config, seed).unwrap();
        rig.turn(rpm).unwrap();
        let started = rig.start(Mode::Torque);
        let expected = if caught { State::Torque } else { State::Fault(Fault::NotCaught) };
        assert_eq!(rig.drive.state(), expected, "{rpm} rpm: {started:?}");
        if !caught {
            rig.wait(0.01);
            rig.run(0.2, |p| assert!(p.torque.abs() < 0.01, "{} Nm", p.torque));
        }
    }
}
