//! Procedure: the three ways to stop, on the simulated rotor with the noise of its sensors.

use crate::common::config;
use drive_core::{Command, Mode, State, Stop};
use hil_sim::rig::{RATE_HZ, Rig};

/// Turns the shaft at `rpm`, stops in this way, and returns the seconds until the outputs are off and the speed then, rpm.
fn stopped(changes: &[&str], mode: Mode, rpm: f64, stop: Stop) -> (f64, f64) {
    let mut rig = Rig::from_config(&config(changes), 1).unwrap();
    rig.start(mode).unwrap();
    let command = match mode {
        Mode::Torque => Command::Torque(0.5 * rpm.signum() as f32),
        _ => Command::Speed(rpm as f32),
    };
    rig.command(&command).unwrap();
    let mut turning = 0.0_f64;
    while (turning - rpm).abs() > 5.0 {
        assert!(rig.time() < 40.0, "{turning} rpm");
        rig.run(0.01, |p| turning = p.speed_rpm);
    }
    rig.command(&Command::Stop(stop)).unwrap();
    let began = rig.time();
    while rig.drive.state() != State::Off {
        rig.run(0.01, |p| turning = p.speed_rpm);
        let state = rig.drive.state();
        assert!(!matches!(state, State::Fault(_)) && rig.time() - began < 20.0, "{state}");
    }
    (rig.time() - began, turning)
}

/// The ramp takes 1 s for 300 rpm, the loop settles within another 0.4 s, and the drive waits 0.1 s at rest. A quick stop with 3 A is 2.6
/// times as fast. A coasting shaft keeps turning.
#[test]
fn ramp_and_quick_stop_bring_the_shaft_to_rest_and_coast_does_not() {
    for changes in
        [["load.mode=free", "angle_source=injection"], ["load.mode=free", "angle_source=encoder"]]
    {
        for (mode, rpm) in [(Mode::Speed, 300.0), (Mode::Speed, -240.0), (Mode::Torque, 300.0)] {
            let run = |stop| stopped(&changes, mode, rpm, stop);
            let [ramp, quick, coast] = [Stop::Ramp, Stop::Quick, Stop::Coast].map(run);
            let takes = rpm.abs() / 300.0;
            assert!((takes..takes + 0.7).contains(&ramp.0), "{ramp:?}");
            assert!((takes / 3.0..takes / 2.6 + 0.7).contains(&quick.0), "{quick:?}");
            assert!(quick.0 < ramp.0 - 0.15, "{quick:?} {ramp:?}");
            assert!(ramp.1.abs() < 12.0 && quick.1.abs() < 12.0, "{ramp:?} {quick:?}");
            assert!(coast.0 < 0.15 && coast.1.abs() > 0.8 * rpm.abs(), "{coast:?}");
        }
    }
}

/// Above the nominal voltage of the link the braking torque is reduced, for every ramp: no trip.
#[test]
fn the_dc_link_holds_a_quick_stop_back() {
    let changes = [
        "load.mode=free",
        "dc_link.capacitor_f=470e-6",
        "dc_link.source=2",
        "dc_link.pulses=0",
        "speed.ramp_rpm_per_s=600",
        "motor.inertia=0.03",
        "drive.motor.inertia=0.03",
    ];
    let (takes, rpm) = stopped(&changes, Mode::Speed, 1500.0, Stop::Quick);
    // The torque of 3 A alone would take 4.8 s with this inertia.
    assert!(takes > 4.0 && rpm.abs() < 12.0, "{takes} s, {rpm} rpm");
}

/// With an S-ramp the acceleration rises and falls in half a second: 300 rpm at 300 rpm/s take 1.5 s instead of 1 s, for a start as for
/// `stop ramp`. The speed does not overshoot by more than the noise, and there is no jerk.
#[test]
fn an_s_ramp_rounds_speed_and_stop() {
    let changes = ["load.mode=free", "angle_source=encoder", "speed.s_ramp_s=0.5"];
    let mut rig = Rig::from_config(&config(&changes), 1).unwrap();
    rig.start(Mode::Speed).unwrap();
    let mut speeds = Vec::new();
    rig.command(&Command::Speed(300.0)).unwrap();
    rig.run(2.5, |p| speeds.push(p.speed_rpm));
    rig.command(&Command::Stop(Stop::Ramp)).unwrap();
    rig.run(2.0, |p| speeds.push(p.speed_rpm));
    assert_eq!(rig.drive.state(), State::Off);
    let at = |t: f64| speeds[(t * 6000.0) as usize];
    // a t^2/(2 s) while the acceleration rises, and the same at the other end; 8 rpm are 30 ms of lag at 300 rpm/s.
    for (t, expected) in
        [(0.5, 75.0), (0.75, 150.0), (1.0, 225.0), (2.4, 300.0), (3.0, 225.0), (3.5, 75.0)]
    {
        assert!((at(t) - expected).abs() < 10.0, "{t} s: {}", at(t));
    }
    let most = speeds.iter().fold(0.0_f64, |m, s| m.max(*s));
    assert!(most < 305.0, "{most}");
    // Acceleration over 0.05 s, rpm/s: it changes by 600 rpm/s in a second, 90 with the noise in 0.1 s.
    let a: Vec<_> = speeds.windows(300).step_by(300).map(|w| (w[299] - w[0]) / 0.05).collect();
    let jerk = a.windows(3).fold(0.0_f64, |m, w| m.max((w[2] - w[0]).abs()));
    assert!(jerk < 100.0, "{jerk}");
}

/// A start at any moment of a stop turns it round, in each mode: the drive regulates at once, the torque never exceeds that of the stop or
/// of the usual ramp, and the speed goes straight from its value in the stop to the new reference.
#[test]
fn a_start_turns_a_stop_round_in_each_mode() {
    const MOMENTS: usize = 100;
    let changes = ["load.mode=free", "prepare.learn=yes", "angle_source=injection"];
    for (mode, stop, seed) in [
        (Mode::Speed, Stop::Ramp, 1),
        (Mode::Speed, Stop::Quick, 2),
        (Mode::Speed, Stop::Coast, 3),
        (Mode::Torque, Stop::Ramp, 4),
        (Mode::Position, Stop::Ramp, 5),
        (Mode::VoltsPerHertz, Stop::Ramp, 6),
    ] {
        let mut rig = Rig::from_config(&config(&changes), seed).unwrap();
        rig.start(mode).unwrap();
        let reference = match mode {
            Mode::Torque => Command::Torque(0.5),
            Mode::Position => Command::Position(10.0),
            _ => Command::Speed(300.0),
        };
        rig.command(&reference).unwrap();
        let mut rpm = 0.0_f64;
        while rpm < 200.0 {
            assert!(rig.time() < 40.0, "{mode:?}: {rpm} rpm");
            rig.run(0.01, |p| rpm = p.speed_rpm);
        }
        rig.command(&Command::Stop(stop)).unwrap();
        let (mut moments, mut largest) = (Vec::new(), 0.0_f64);
        while rig.drive.state() != State::Off {
            moments.push(rig.clone());
            rig.run(1.0 / RATE_HZ, |p| largest = largest.max(p.torque.abs()));
        }
        for n in 0..MOMENTS {
            let mut rig = moments[n * (moments.len() - 1) / (MOMENTS - 1)].clone();
            let from = rig.drive.state();
            rig.command(&Command::Start(mode)).unwrap();
            assert_eq!(rig.drive.state(), State::of_mode(mode), "{from}");
            if mode != Mode::Position {
                rig.command(&reference).unwrap();
            }
            let (mut speeds, mut torque) = (Vec::new(), 0.0_f64);
            rig.run(1.5, |p| {
                speeds.push(p.speed_rpm);
                torque = torque.max(p.torque.abs());
            });
            let (first, last) = (speeds[0], speeds[speeds.len() - 1]);
            let least = speeds.iter().copied().fold(first, f64::min);
            let case = format!(
                "{mode:?} {stop:?} at {n} from {from}: {first} {least} {last} rpm, {torque} Nm"
            );
            assert_eq!(rig.drive.state(), State::of_mode(mode), "{case}");
            assert!(torque < 1.35 * largest, "{case}, {largest} Nm");
            let reaches = match mode {
                Mode::Torque => last > first + 100.0,
                Mode::Position => last.abs() < 40.0 && least > first.min(0.0) - 12.0,
                _ => (last - 300.0).abs() < 20.0,
            };
            assert!(reaches, "{case}");
            assert!(mode == Mode::Position || least > first - 40.0, "{case}");
        }
    }
}
