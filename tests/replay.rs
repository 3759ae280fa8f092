//! Recorded samples and requests, replayed through the host drive, give unchanged outputs and estimates.
//!
//! [`board`] has two runs of the image, [`scenes`] runs of the simulated bench that lead through the other states; [`player`] plays both.
//!
//! If a change is meant to leave the control as it is, these hashes stay as they are. If a change alters the control on purpose, the
//! hashes change too, and its commit names the cause.

mod board;
mod packed;
pub mod player;
mod scenes;

use std::fs;

use drive_core::Drive;
use drive_core::learned::Learned;
use player::{BLOCK, Hashes, replay};
use scenes::SCENES;

/// Path of a file of a run, without its ending.
fn recorded(name: &str) -> String {
    format!("{}/tests/recorded/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Replays a recorded scene; returns the drive at its end, and the hashes of each block.
fn replayed(name: &str) -> (Drive, Vec<Hashes>) {
    let scene = SCENES.iter().find(|scene| scene.name == name).unwrap();
    let path = recorded(name);
    let samples = packed::unpack(&fs::read(format!("{path}.packed")).unwrap());
    let orders = fs::read_to_string(format!("{path}.orders")).unwrap();
    replay(scene, &samples, &orders)
}

/// The result of the recorded self-commissioning.
fn learned() -> Learned {
    *replayed("learning").0.learned().unwrap()
}

/// Compares each block of a recorded scene with its hashes.
fn check(name: &str) {
    let expected = fs::read_to_string(format!("{}.hashes", recorded(name))).unwrap();
    let (_, found) = replayed(name);
    assert_eq!(found.len(), expected.lines().count());
    for (block, (found, expected)) in found.iter().zip(expected.lines()).enumerate() {
        let second = (block * BLOCK) as f64 / 6000.0;
        assert_eq!(found.to_string(), expected, "{name}, outputs and beliefs from {second} s on");
    }
}

macro_rules! scenes {
    ($($name:ident)*) => {
        $(#[test] fn $name() { check(stringify!($name)); })*
        const TESTED: &[&str] = &[$(stringify!($name)),*];
    };
}
scenes! {
    volts_per_hertz turning_start stopped_starts learning commissioning stops stopped_learning faults weakening position encoder_speed
}

#[test]
fn every_scene_is_tested() {
    let names: Vec<_> = SCENES.iter().map(|scene| scene.name).collect();
    assert_eq!(names, TESTED);
}

/// Records again the scenes whose names contain the value of `SCENE`:
/// `SCENE=stops cargo test --release --test procedures record_again -- --ignored`.
#[test]
#[ignore = "it replaces the yardstick"]
fn record_again() {
    let wanted = std::env::var("SCENE").expect("SCENE is a part of the names of the scenes");
    for scene in SCENES.iter().filter(|scene| scene.name.contains(&wanted)) {
        let bench = scene.play();
        let (drive, hashes) = replay(scene, &bench.samples, &bench.orders);
        assert_eq!(drive.telemetry(), bench.rig.drive.telemetry(), "{}", scene.name);
        assert_eq!(drive.state(), bench.rig.drive.state());
        let path = recorded(scene.name);
        fs::write(format!("{path}.packed"), packed::pack(&bench.samples)).unwrap();
        fs::write(format!("{path}.orders"), &bench.orders).unwrap();
        let lines: String = hashes.iter().map(|block: &Hashes| format!("{block}\n")).collect();
        fs::write(format!("{path}.hashes"), lines).unwrap();
        println!("{}: {} periods", scene.name, bench.samples.len());
    }
}
