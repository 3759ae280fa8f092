//! Procedure: at standstill more torque is requested than motor or inverter carry continuously.

use crate::common::config;
use drive_core::{Command, Limiting, Mode, State};
use hil_sim::rig::Rig;

/// Largest load of an i²t body of `tau_s` s that carries `carried` A continuously, with the true current; the mean current of the last
/// second, A; share of the next second in which this limits.
fn settles(
    changes: &[&str],
    (carried, tau_s, why): (f64, f64, Limiting),
    seconds: f64,
) -> (f64, f64, f64) {
    let mut rig = Rig::from_config(&config(changes), 1).unwrap();
    rig.start(Mode::Torque).unwrap();
    rig.command(&Command::Torque(3.0)).unwrap();
    let (mut load, mut most) = (0.0_f64, 0.0_f64);
    let (mut sum, mut n) = (0.0, 0.0);
    let end = rig.time() + seconds;
    rig.run(seconds, |p| {
        let square = p.iq * p.iq + p.id * p.id;
        load += (square / (carried * carried) - load) / (tau_s * 6000.0);
        most = most.max(load);
        if p.t > end - 1.0 {
            (sum, n) = (sum + square, n + 1.0);
        }
    });
    assert_eq!(rig.drive.state(), State::Torque, "{changes:?}");
    let limits = |_: &u32| {
        rig.wait(0.01);
        rig.drive.limiting() == why
    };
    let limited = (0..100).filter(limits).count();
    (most, (sum / n).sqrt(), limited as f64 / 100.0)
}

/// The shaft is locked, and 3 A are requested. The current settles at the continuous limit, including its d-axis part: from half the
/// limit to nearly all of it, with slow bodies and with the fastest that the settings allow.
#[test]
fn the_torque_falls_back_to_what_is_carried_for_ever() {
    for (who, carried, tau_s, why) in [
        ("motor", 1.5, 5.0, Limiting::Motor),
        ("motor", 2.5, 1.0, Limiting::Motor),
        ("inverter", 2.0, 0.5, Limiting::Inverter),
        ("inverter", 2.6, 0.1, Limiting::Inverter),
    ] {
        let (a, s) = (format!("limits.{who}_a={carried}"), format!("limits.{who}_s={tau_s}"));
        for source in ["angle_source=injection", "angle_source=encoder"] {
            let changes = [a.as_str(), s.as_str(), source, "load.mode=locked"];
            let body = (carried, tau_s, why);
            let (load, current, limited) = settles(&changes, body, 3.0 + 4.0 * tau_s);
            assert!(load <= 1.1, "{load}");
            assert!((current / carried - 1.0).abs() < 0.03, "{current} A");
            // The load of the fastest body swings with the noise of the current.
            let least = if tau_s < 0.5 { 0.3 } else { 1.0 };
            assert!(limited >= least, "{limited}");
        }
    }
}

/// If the d-axis current alone is too large, less torque does not help: the drive trips.
#[test]
fn what_cannot_fall_back_trips() {
    let changes =
        ["limits.motor_a=0.5", "limits.motor_s=1", "angle_source=encoder", "load.mode=locked"];
    let mut rig = Rig::from_config(&config(&changes), 1).unwrap();
    rig.command(&Command::Start(Mode::Torque)).unwrap();
    rig.wait(3.0);
    assert_eq!(rig.drive.state(), State::Fault(drive_core::Fault::MotorOverload));
}
