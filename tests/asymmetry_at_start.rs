//! Procedure: the sensors drift after the self-commissioning. The next start measures by how much they differ, so that torque at
//! standstill has the right angle.

use crate::common::{Rig, angle_error, config};
use drive_core::{Command, Fault, Mode, State};
use hil_sim::config::plant_settings;
use hil_sim::plant::{Load, Plant};

/// A motor with saturation, at high flux.
const IRON: [&str; 4] = ["plant=r", "flux_level=high", "sequence.flux=high", "prepare.learn=yes"];

/// A drive that has learned, with these changes since then.
fn changed(changes: &[&str]) -> Rig {
    let learned = Rig::from_config(&config(&IRON), 3).unwrap();
    let mut plant = plant_settings(&config(&[&IRON, changes].concat()));
    plant.mechanics.load = Load::Locked;
    Rig::of(Plant::new(&plant, 7).unwrap(), learned.drive)
}

/// Mean angle error, degrees, in the third second under torque, with these changes since the self-commissioning.
fn mean_error(changes: &[&str], i_q: f32) -> f64 {
    let mut rig = changed(changes);
    rig.start(Mode::Torque).unwrap();
    rig.command(&Command::Torque(i_q)).unwrap();
    rig.wait(2.0);
    let error = angle_error(&mut rig, 1.0);
    assert_eq!(rig.drive.state(), State::Torque, "{changes:?}");
    error.mean()
}

/// If it is not measured, a gain that is 2 % higher stops the drive by fault 26.
#[test]
fn a_start_measures_what_has_changed_since_the_learning() {
    for changes in [
        ["measurement.gain_error_a=0.02"],
        ["measurement.gain_error_b=0.02"],
        ["measurement.cross_talk_a=0.01"],
        ["measurement.cross_talk_a=-0.01"],
    ] {
        for i_q in [2.5, -2.5] {
            let error = mean_error(&changes, i_q);
            assert!(error.abs() < 4.0, "{changes:?}, {i_q} A: {error}");
        }
    }
}

/// A gain error of 30 % is more than drift: the start ends before there is flux.
#[test]
fn more_asymmetry_than_a_learning_accepts_is_a_fault() {
    for change in ["measurement.gain_error_a=0.3", "measurement.gain_error_b=-0.3"] {
        let mut rig = changed(&[change]);
        assert!(rig.start(Mode::Torque).is_err(), "{change}");
        assert_eq!(rig.drive.state(), State::Fault(Fault::NothingLearned), "{change}");
    }
}
