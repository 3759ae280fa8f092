//! Procedure: the first start after the defaults, with the wiring right and wrong. No current may reach 0.5 A during the check.

use crate::common::config;
use drive_core::{Command, Compare, Drive, Fault, FrontEndState, Mode, Sample, State};
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::config::plant_settings;
use hil_sim::plant::{Channel, CurrentFault, Plant};

/// Error between the drive and the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wiring {
    Right,
    /// The gates of two legs are exchanged.
    Legs(usize, usize),
    /// The sensors are exchanged between the two phases.
    Sensors,
    /// Sensor a, or b, is the wrong way round.
    Reversed(Channel),
    Open(Channel),
}

/// Starts with the check and runs to its end; returns the state after it, and the largest phase current until then, A.
fn check(wiring: Wiring, changes: &[&str], seed: u64) -> (State, f64) {
    check_of(wiring, &config(changes), seed)
}

fn check_of(wiring: Wiring, config: &Config, seed: u64) -> (State, f64) {
    let drive_settings = config.drive;
    let mut drive = Drive::new(drive_settings.build().unwrap());
    let mut plant = Plant::new(&plant_settings(config), seed).unwrap();
    if let Wiring::Open(channel) = wiring {
        plant.set_current_fault(channel, CurrentFault::Open);
    }
    drive.command(&Command::CheckWiring).unwrap();
    drive.command(&Command::Start(Mode::Torque)).unwrap();
    let (mut front_end, mut peak) = (FrontEndState::default(), 0.0_f64);
    for _ in 0..6000 {
        let mut sample = plant.sample();
        let zero = |line: drive_core::Line| (-2.0 * line.offset / line.gain) as u16;
        match wiring {
            Wiring::Sensors => {
                sample =
                    Sample { current_a: sample.current_b, current_b: sample.current_a, ..sample };
            }
            Wiring::Reversed(Channel::A) => {
                sample.current_a = zero(drive_settings.scales.current_a) - sample.current_a;
            }
            Wiring::Reversed(Channel::B) => {
                sample.current_b = zero(drive_settings.scales.current_b) - sample.current_b;
            }
            _ => {}
        }
        let (compare, output) = drive.period(&mut front_end, &sample, &mut |_| {});
        plant.period(&exchanged(wiring, compare), &output);
        if drive.state() == State::CheckingWiring {
            peak = plant.phase_currents().iter().fold(peak, |p, i| p.max(i.abs()));
        }
        if matches!(drive.state(), State::FlyingStart | State::Fault(_)) {
            break;
        }
    }
    (drive.state(), peak)
}

fn exchanged(wiring: Wiring, compare: Compare) -> Compare {
    let mut legs = [compare.a, compare.b, compare.c];
    if let Wiring::Legs(one, other) = wiring {
        legs.swap(one, other);
    }
    let [a, b, c] = legs;
    Compare { a, b, c, ..compare }
}

/// Every motor file with the dead time of the reference board, which a pulse for the leakage of a spindle hardly exceeds, at each
/// switching frequency.
#[test]
fn the_right_wiring_of_every_motor_is_accepted() {
    for motor in Motor::all() {
        for khz in [6, 12, 18] {
            let changes =
                ["inverter.dead_time_s=2.2e-6".to_owned(), format!("inverter.switching_khz={khz}")];
            let config = Config::load(Some(&motor.name), None, &changes).unwrap();
            let range = config.measurement.range_a;
            for seed in 0..12 {
                let (state, peak) = check_of(Wiring::Right, &config, seed);
                assert_eq!(state, State::FlyingStart, "{} {khz} kHz, seed {seed}", motor.name);
                assert!(peak < 0.4 * range, "{} {khz} kHz, seed {seed}: {peak} A", motor.name);
            }
        }
    }
}

/// Largest current while checking, A.
const BOUND_A: f64 = 0.5;

/// The motor may have half or twice the resistance and the transient inductance of the settings (both leakages in proportion: they make
/// up the transient inductance except for 7 %).
#[test]
fn the_right_wiring_is_accepted_over_motors_and_seeds() {
    let mut largest = 0.0_f64;
    for resistance in [2.7, 5.4, 10.8] {
        for leakage in [0.0138, 0.0276, 0.0552] {
            for seed in 0..12 {
                let motor = [
                    format!("motor.r_s={resistance}"),
                    format!("motor.l_ls={leakage}"),
                    format!("motor.l_lr={leakage}"),
                    // The resistance in the drive's settings stays.
                    "drive.motor.r_s=5.4".into(),
                    "drive.motor.l_ls=0.0276".into(),
                    "drive.motor.l_lr=0.0276".into(),
                ];
                let motor: Vec<&str> = motor.iter().map(String::as_str).collect();
                let (state, peak) = check(Wiring::Right, &motor, seed);
                assert_eq!(state, State::FlyingStart, "{motor:?}, seed {seed}");
                largest = largest.max(peak);
            }
        }
    }
    assert!(largest < BOUND_A && largest > 0.1, "{largest} A");
}

#[test]
fn every_wrong_wiring_is_named_and_no_current_comes_near_half_an_ampere() {
    let table = [
        (Wiring::Legs(0, 1), Fault::WiringExchanged),
        (Wiring::Legs(1, 2), Fault::WiringExchanged),
        (Wiring::Legs(0, 2), Fault::WiringExchanged),
        (Wiring::Sensors, Fault::WiringExchanged),
        (Wiring::Reversed(Channel::A), Fault::WiringPolarityA),
        (Wiring::Reversed(Channel::B), Fault::WiringPolarityB),
        (Wiring::Open(Channel::A), Fault::WiringNoCurrent),
        (Wiring::Open(Channel::B), Fault::WiringNoCurrent),
    ];
    for (wiring, fault) in table {
        for seed in 0..20 {
            let (state, peak) = check(wiring, &[], seed);
            assert_eq!(state, State::Fault(fault), "{wiring:?}, seed {seed}");
            assert!(peak < BOUND_A, "{wiring:?}: {peak} A");
        }
    }
}

/// A motor with a fifth of the inductance of the settings is detected at the first sample.
#[test]
fn a_motor_that_is_far_from_its_settings_is_refused_below_the_bound() {
    for seed in 0..10 {
        let motor = [
            "motor.l_ls=0.0055",
            "motor.l_lr=0.0055",
            "drive.motor.l_ls=0.0276",
            "drive.motor.l_lr=0.0276",
        ];
        let (state, peak) = check(Wiring::Right, &motor, seed);
        assert_eq!(state, State::Fault(Fault::WiringCurrent), "seed {seed}");
        assert!(peak < BOUND_A, "{peak} A");
    }
}
