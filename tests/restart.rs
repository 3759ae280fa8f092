//! Procedure: start on a shaft that rotates at any speed, with and without knowledge from a run before.

use std::f64::consts::TAU;

use crate::common::coast;
use drive_core::{Command, Drive, Mode, State};
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::SplitMix64;

/// Share of the rated speed below which a shaft counts as standing.
const STANDS: f64 = 0.05;
/// Least share of the speed that a coasting shaft would have, while the drive looks for it and builds up the flux.
const KEEPS: f64 = 0.9;

/// Number of restarts with each result.
#[derive(Debug, Default, PartialEq)]
struct Restarts {
    /// The drive ended in a fault.
    faults: u32,
    /// It ran in the other sense than the shaft.
    wrong: u32,
    /// It drove d-axis current in a fixed frame into a rotating shaft.
    braked: u32,
    /// The shaft lost more speed than [`KEEPS`] allows.
    slowed: u32,
}

/// One restart.
#[derive(Debug)]
struct Draw {
    /// Speed before the coast, as a share of the rated one, and its sense.
    share: f64,
    /// Duration of the coast, s.
    coast: f64,
    /// Share of the speed that a load takes during the coast, beside the friction.
    load: f64,
    /// Whether the drive has lost all knowledge of the run.
    power_up: bool,
}

impl Draw {
    fn new(number: u32, seed: u32) -> Self {
        let state = (u64::from(seed) << 32 | u64::from(number)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut random = SplitMix64::from_seed(state.to_le_bytes());
        let mut next = || random.random::<f64>();
        let share = 0.1 + 0.9 * next();
        Self {
            share: if next() < 0.5 { -share } else { share },
            coast: 0.2 * 25.0_f64.powf(next()),
            load: if next() < 0.5 { next() } else { 0.0 },
            power_up: number % 10 == 9,
        }
    }
}

/// Restarts this motor after these draws; returns no result if it cannot be learned.
fn restarts(motor: &str, plant: &str, draws: impl Iterator<Item = Draw>) -> Option<Restarts> {
    let plant = format!("plant={plant}");
    let changes = [plant.as_str(), "load.mode=free", "angle_source=injection", "prepare.learn=yes"];
    let mut config = Config::load(Some(motor), None, &changes).unwrap();
    let c = &mut config.drive;
    let rated = f64::from(c.nameplate.frequency_hz) * 60.0 / f64::from(c.motor.pole_pairs);
    (c.limits.speed_rpm, c.speed.limit_rpm) = (Some(1.2 * rated as f32), Some(1.1 * rated as f32));
    let learned = Rig::from_config(&config, 1).ok()?;
    let mut fresh = config.drive.build().unwrap();
    fresh.take(learned.drive.learned().unwrap());

    let mut results = Restarts::default();
    for draw in draws {
        let mut rig = learned.clone();
        let before = draw.share * rated;
        rig.turn(0.0).unwrap();
        if !draw.power_up {
            rig.start(Mode::Torque).unwrap();
        }
        // The drive follows a shaft that is driven.
        rig.bring_to(before, 50, 0.02).unwrap();
        if !draw.power_up {
            assert_eq!(rig.drive.state(), State::Torque, "{motor} {plant} {draw:?}");
            coast(&mut rig);
        }
        let inertia = f64::from(config.drive.inertia());
        rig.set_load(Load::Free { torque: draw.load * before * TAU / 60.0 * inertia / draw.coast })
            .unwrap();
        rig.wait(draw.coast);
        rig.set_load(Load::Free { torque: 0.0 }).unwrap();
        if draw.power_up {
            rig.drive = Drive::new(fresh);
        }
        let mut coasting = rig.clone();
        let found = rig.rpm();
        let rotates = found.abs() > STANDS * rated;
        rig.command(&Command::Start(Mode::Speed)).unwrap();
        let (mut braked, mut least) = (false, 1.0_f64);
        while !matches!(rig.drive.state(), State::Speed | State::Fault(_)) {
            let state = rig.drive.state();
            let mut coasts = 0.0;
            coasting.run(0.001, |p| coasts = p.speed_rpm * found.signum());
            rig.run(0.001, |p| {
                let speed = p.speed_rpm * found.signum();
                // Noise of the speed near standstill does not count.
                let share = (speed + 0.02 * rated) / (coasts.abs() + 0.02 * rated);
                least = if state == State::FlyingStart { least.min(share) } else { least };
                let stands = state == State::Magnetising && p.current > 0.2;
                braked |= stands && speed.abs() > STANDS * rated;
            });
        }
        let _ = rig.command(&Command::Speed(found as f32));
        rig.wait(0.5);
        let now = rig.rpm() * found.signum();
        let runs = rig.drive.state() == State::Speed;
        let slowed = runs && rotates && least < KEEPS;
        if !runs || braked || slowed || (rotates && now < 0.0) {
            let state = rig.drive.state();
            println!("{motor} {plant} {draw:.2?}: found {found:.0}, keeps {least:.2}, {state}");
        }
        results.faults += u32::from(!runs);
        results.wrong += u32::from(runs && rotates && now < 0.0);
        results.braked += u32::from(braked);
        results.slowed += u32::from(slowed);
    }
    Some(results)
}

/// After a run the drive finds the shaft at any speed, of the fastest as of the slowest motor, and hardly brakes it. After a power-up it finds a
/// spindle above the 91 Hz that a fixed frame shows.
#[test]
fn a_rotating_shaft_is_found_at_any_speed() {
    for (motor, plant, slow) in [
        ("spindle-2kw2", "a", 1),
        ("spindle-2kw2", "g7", 1),
        ("modelica-18kw5", "r", 4),
        ("kart-5kw3", "a", 2),
    ] {
        let found = restarts(motor, plant, (0..10).map(|n| Draw::new(n, 1))).unwrap();
        let Restarts { faults, wrong, braked, slowed } = found;
        assert!(faults + wrong + braked == 0 && slowed <= slow, "{motor} {plant}: {found:?}");
    }
}

/// After a power-up nothing is known of a shaft that rotates. A fixed frame with the whole current would reverse the lightest ones.
#[test]
fn a_light_shaft_is_not_reversed_after_a_power_up() {
    for (motor, plant) in [("buildings-4kw", "r"), ("kart-5kw3", "g7")] {
        let draws = (0..10).map(|n| Draw { power_up: true, ..Draw::new(n, 3) });
        let Restarts { faults, wrong, braked, .. } = restarts(motor, plant, draws).unwrap();
        assert_eq!((faults, wrong, braked), (0, 0, 0), "{motor} {plant}");
    }
}

/// Prints the results of 200 restarts of each motor of the list on three kinds of iron.
#[test]
#[ignore = "takes ten minutes: the table of a review"]
fn two_hundred_restarts_of_each_motor() {
    for motor in Motor::all() {
        for plant in ["a", "r", "g7"] {
            println!(
                "{} {plant}: {:?}",
                motor.name,
                restarts(&motor.name, plant, (0..200).map(|n| Draw::new(n, 2)))
            );
        }
    }
}
