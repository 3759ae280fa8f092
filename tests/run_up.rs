//! Procedure: run-up of every motor to its rated speed with the defaults.

use drive_core::{Command, Mode, State};
use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::rig::Rig;

/// Longest run-up, s, and the share of the rated speed that ends it.
const LONGEST_S: f64 = 8.0;
const THERE: f64 = 0.98;

/// Returns the duration of the run-up of a motor without load, s, and the largest speed afterwards as a share of the rated speed.
fn run_up(motor: &str, changes: &[&str]) -> Result<(f64, f64), State> {
    let free = ["load.mode=free", "load.torque_nm=0"];
    let changes = [&free, changes].concat();
    let config = Config::load(Some(motor), None, &changes).unwrap();
    let rated = f64::from(config.drive.nameplate.speed_rpm);
    let mut rig = Rig::from_config(&config, 1).unwrap();
    let state = |rig: &Rig| rig.drive.state();
    rig.start(Mode::Speed).map_err(|_| state(&rig))?;
    rig.command(&Command::Speed(rated as f32)).unwrap();
    let (start, mut there, mut most) = (rig.time(), None, 0.0_f64);
    while rig.time() < start + LONGEST_S + 2.0 {
        rig.run(0.01, |p| most = most.max(p.speed_rpm / rated));
        if state(&rig) != State::Speed {
            return Err(state(&rig));
        }
        if there.is_none() && most >= THERE {
            there = Some(rig.time() - start);
        }
    }
    there.map(|s| (s, most)).ok_or_else(|| state(&rig))
}

/// Each motor of the list reaches its rated speed: with its inertia known, and by rule, which may be several times too small.
fn all_reach(changes: &[&str]) {
    // That motor cannot be learned on that plant.
    let learns = |motor: &Motor| motor.name != "rewound-48v" || !changes.contains(&"plant=g7");
    for motor in Motor::all().into_iter().filter(learns) {
        for inertia in [&[][..], &["drive.motor.inertia=auto"]] {
            let found = run_up(&motor.name, &[changes, inertia].concat());
            assert!(
                found.is_ok_and(|(s, most)| s < LONGEST_S && most < 1.1),
                "{} {changes:?} {inertia:?}: {found:?}",
                motor.name
            );
        }
    }
}

#[test]
fn each_motor_reaches_its_rated_speed_within_eight_seconds() {
    all_reach(&[]);
}

/// The same on two models with saturation, after the learning.
#[test]
#[ignore = "long: the table of a review"]
fn each_motor_reaches_its_rated_speed_with_saturation() {
    for plant in ["plant=r", "plant=g7"] {
        all_reach(&[plant, "prepare.learn=yes"]);
    }
}
