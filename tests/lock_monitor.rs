//! Procedure: throw the sensorless drive off its flux, and check that it detects this; check that it does not stop a healthy one.

use crate::common::{angle_error, config, regulating, run};
use drive_core::{Command, Fault, Mode, State};

/// A part of the runs of `cargo sim run lock-monitor --set runs=1000`.
#[test]
fn a_lost_lock_is_noticed_and_a_sound_one_left_alone() {
    let outcome = run("lock-monitor", &["runs=12"], 31);
    for metric in [
        "not_in_time_p90",
        "not_in_time_m90",
        "not_in_time_p120",
        "not_in_time_m120",
        "not_in_time_180",
        "false_alarms",
        "over_speed_late",
        "wrong_starts",
        "refused_at_rest",
    ] {
        assert_eq!(outcome.metrics.get(metric), Some(0.0), "{metric}");
    }
    // 0.22 is the largest of 10 000 runs; the limit is 0.55.
    assert!(outcome.metrics.get("healthy_loss_max").unwrap() < 0.35);
}

/// Without the monitor and the observer the same trials end in undetected false locks.
#[test]
fn without_the_monitor_a_false_lock_stays() {
    let blind = ["runs=6", "injection.monitor=false", "observer.enabled=false"];
    let outcome = run("lock-monitor", &blind, 32);
    let missed = ["p120", "m120", "180"].map(|n| outcome.metrics.get(&format!("not_in_time_{n}")));
    assert!(missed.into_iter().flatten().sum::<f64>() >= 4.0, "{missed:?}");
}

#[test]
fn a_lost_lock_is_found_again_after_a_clear_and_a_start() {
    for (seed, i_q) in [(1, 1.0), (2, -2.0), (3, 0.5)] {
        let mut rig = regulating(&config(&[]), seed, i_q, 1.0);
        rig.plant.turn_rotor_flux(std::f64::consts::PI);
        rig.wait(1.5);
        assert_eq!(rig.drive.state(), State::Fault(Fault::LostLock));
        rig.command(&Command::Clear).unwrap();
        rig.start(Mode::Torque).unwrap();
        rig.command(&Command::Torque(i_q)).unwrap();
        rig.wait(0.5);
        let worst = angle_error(&mut rig, 1.0).largest();
        assert!(worst < 12.0, "seed {seed}: {worst}");
    }
}

#[test]
fn a_relock_on_request_goes_on_without_torque() {
    for (seed, i_q) in [(4, 3.0), (5, -1.0)] {
        let mut rig = regulating(&config(&[]), seed, i_q, 1.0);
        rig.command(&Command::Relock).unwrap();
        assert!(
            matches!(rig.command(&Command::Relock), Err(error) if error.to_string().contains("magnetising"))
        );
        let mut verified = false;
        for _ in 0..12_000 {
            rig.step();
            verified |= rig.drive.state() == State::Verifying;
            if rig.drive.state() == State::Torque {
                break;
            }
        }
        assert!(verified && rig.drive.state() == State::Torque, "{}", rig.drive.state());
        assert!(rig.drive.telemetry().reference.q.abs() < 1e-6);
        // The remaining flux is not taken for a resistance.
        let deviation = rig.drive.stator_resistance().unwrap();
        assert!(deviation.abs() < 0.05, "seed {seed}: {deviation}");
        rig.command(&Command::Torque(i_q)).unwrap();
        rig.wait(0.5);
        let worst = angle_error(&mut rig, 1.0).largest();
        assert!(worst < 12.0, "seed {seed}: {worst}");
    }
}

/// If the dc link is too low for the full injected voltage, the voltage is reduced, and the angle stays right.
#[test]
fn a_carrier_that_does_not_fit_is_made_smaller_and_the_angle_stays_right() {
    let low = config(&["inverter.dc_link_v=203", "injection.amplitude_v=103"]);
    let mut rig = regulating(&low, 6, 2.5, 1.0);
    let worst = angle_error(&mut rig, 1.0).largest();
    let share = rig.drive.telemetry().carrier_share;
    assert_eq!(rig.drive.state(), State::Torque);
    assert!(share < 1.0 && share > 0.8, "{share}");
    assert!(worst < 12.0, "{worst}");
}
