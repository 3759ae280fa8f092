//! The bench that the procedures share.

use drive_core::{Command, Mode, Stop};
use drive_settings::Settings;
pub use hil_sim::config::plant_settings;
use hil_sim::plant::PlantSettings;
pub use hil_sim::rig::Rig;
use hil_sim::stats::Stats;
use hil_sim::{Config, Outcome, experiments};

/// The configuration with these changes, `key=value`.
pub fn config(changes: &[&str]) -> Config {
    Config::load(None, None, changes).unwrap()
}

/// No noise, an ADC of 16 bits, no analog filter, an ideal inverter.
pub const IDEAL: [&str; 6] = [
    "measurement.noise_a=0",
    "measurement.lsb_a=0.00014",
    "measurement.filter_hz=0",
    "inverter.residual_v=0",
    "inverter.dead_time_s=0",
    "inverter.propagation_us=0",
];

/// The textbook machine.
pub const ISOTROPIC: [&str; 2] = ["saliency.a_psi=0", "saliency.b1=0"];

/// All of these changes.
pub fn all(parts: &[&[&'static str]]) -> Vec<&'static str> {
    parts.concat()
}

/// Result of an experiment with these changes.
pub fn run(experiment: &str, changes: &[&str], seed: u64) -> Outcome {
    experiments::run(experiment, &config(changes), seed).unwrap()
}

/// A drive that regulates torque with the reference `i_q`, A, after `settle` s.
pub fn regulating(config: &Config, seed: u64, i_q: f32, settle: f64) -> Rig {
    regulating_with(&plant_settings(config), &config.drive, seed, i_q, settle)
}

/// A drive that regulates torque by the encoder, with the shaft locked and the injection running beside it.
pub fn beside_encoder(config: &Config, seed: u64, i_q: f32, settle: f64) -> Rig {
    Rig::oriented(config, seed, i_q.into(), settle).unwrap()
}

/// Statistics of the angle error in the next seconds, degrees.
pub fn angle_error(rig: &mut Rig, seconds: f64) -> Stats {
    let [error] = rig.stats(seconds, |p| [p.angle_error_deg]);
    error
}

/// Stops the drive without braking, and waits until its outputs are off.
pub fn coast(rig: &mut Rig) {
    rig.command(&Command::Stop(Stop::Coast)).unwrap();
    while !rig.drive.is_off() {
        rig.wait(0.001);
    }
}

/// A drive that regulates torque, from settings.
pub fn regulating_with(
    plant: &PlantSettings,
    drive: &Settings,
    seed: u64,
    i_q: f32,
    settle: f64,
) -> Rig {
    let mut rig = Rig::new(plant, drive, seed).unwrap();
    rig.start(Mode::Torque).unwrap();
    rig.settle(&Command::Torque(i_q), settle).unwrap();
    rig
}
