//! Angle error of a drive without a position sensor, with each demodulation.

use drive_core::carrier::CARRIER_SAMPLES;

use crate::as_printed::LEVELS_A;
use crate::prelude::*;

/// Time at each level of Figure 38, s.
const LEVEL_S: f64 = 0.6;
/// Time after the first level that is not judged, s: the angle settles from the magnetising position.
const SETTLING_S: f64 = 0.5;

/// A run through the torque steps.
#[derive(Clone, Debug)]
pub struct StepsRun {
    /// Angle error after settling, degrees.
    pub stats: Stats,
    /// Whether the error exceeded 45°, or the drive stopped itself.
    pub lost: bool,
}

/// Runs the torque steps with the shaft locked.
///
/// # Errors
/// As [`Rig::new`] and [`Rig::start`].
pub fn steps(config: &Config, seed: u64) -> Result<StepsRun, Error> {
    let mut config = config.clone();
    config.load.mode = LoadMode::Locked;
    let mut rig = Rig::started(&config, seed, Mode::Torque)?;
    let start = rig.time();
    let mut stats = Stats::default();
    for iq in LEVELS_A.map(|iq| config.amperes(iq)) {
        if rig.drive.state().fault().is_some() {
            break;
        }
        rig.command(&Command::Torque(iq as f32))?;
        for _ in 0..(LEVEL_S * RATE_HZ) as usize / CARRIER_SAMPLES {
            let t = rig.time() - start;
            rig.run(CARRIER_SAMPLES as f64 / RATE_HZ, |p| {
                if t >= SETTLING_S {
                    stats.push(p.angle_error_deg);
                }
            });
        }
    }
    let lost = stats.largest() > LOST_DEG || rig.drive.state().fault().is_some();
    Ok(StepsRun { stats, lost })
}
