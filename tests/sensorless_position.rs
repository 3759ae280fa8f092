//! Procedure: position without an encoder, on the simulated rotor: the conditions under which the position is held. The rows
//! `five-turns`, `five-turns-back`, `quarter-turn` and `minute-at-rest` of `rows.txt` are steps, and a shaft without load.

use std::f64::consts::TAU;

use crate::common::config;
use drive_core::Mode;
use hil_sim::Config;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;

fn started(config: &Config, seed: u64) -> Rig {
    let mut rig = Rig::from_config(config, seed).unwrap();
    rig.start(Mode::Position).unwrap();
    rig
}

fn degrees(rig: &Rig) -> f64 {
    rig.plant.mechanical_angle() / TAU * 360.0
}

/// Under load the drift is that of the rotor resistance in the settings: dslip = i_q / i_d / T_r times its error, half of it mechanical.
/// This equals the statement in the documentation.
#[test]
fn under_load_the_drift_is_the_error_of_the_slip() {
    let believed = 1.1;
    let drift = |warmer: f64, seed: u64| {
        let (rr, drive) = (believed * warmer, believed);
        let keys = [
            "load.mode=free".to_owned(),
            format!("motor.r_r={rr}"),
            format!("drive.motor.r_r={drive}"),
        ];
        let mut rig = started(&config(&keys.each_ref().map(String::as_str)), seed);
        rig.set_load(Load::Free { torque: 0.3 }).unwrap();
        rig.wait(2.0);
        let before = degrees(&rig);
        let [i_q] = rig.stats(10.0, |p| [p.iq]);
        (degrees(&rig) - before, i_q.mean())
    };
    let (known, _) = drift(1.0, 5);
    let (wrong, i_q) = drift(1.1, 6);
    let t_r = 0.2047 / believed;
    let expected = -0.1 * i_q / 0.7 / t_r * 10.0 / 2.0 * 360.0 / TAU;
    // Noise walks by 10 degrees, a bias of 0.3 degrees causes 25.
    assert!(known.abs() < 45.0, "{known}");
    assert!((wrong / expected - 1.0).abs() < 0.25, "{wrong} against {expected}");
}
