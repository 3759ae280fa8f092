//! Saliency self-commissioning of a drive on a simulated motor with the shaft locked.

use drive_core::learned::Learned;
use drive_core::table::{Grid, POINTS, ReferenceTable};

use crate::prelude::*;

/// Returns the values that the drive of the configuration learns.
///
/// # Errors
/// As [`Rig::from_config`] and [`Rig::learn`].
pub fn learned(config: &Config, seed: u64) -> Result<Learned, Error> {
    let mut config = config.clone();
    config.load.mode = LoadMode::Locked;
    config.prepare.learn = false;
    Rig::from_config(&config, seed)?.learn()
}

/// Last point of [`reference_of`]: 3.25 A, the largest q-axis current that the drive allows beside the magnetising current.
const LAST: usize = 13;
/// Time for flux and averages to settle at each point, s; the averaging takes the same time.
const SETTLE_S: f64 = 0.6;
const AVERAGE_S: f64 = 0.5;

/// Measures the signal of a demodulation over the q-axis current at the true flux angle, as a table of the saliency
/// offset. The shaft is locked and an encoder orients the drive by the slip alone, because a locked encoder counts
/// nothing; the injection is on. The function also covers the literal demodulation, for which the drive has no saliency
/// self-commissioning.
///
/// # Errors
/// [`Error::Refused`] if the configuration or a value of the table is refused, or if the drive stops.
pub fn reference_of(
    demodulator: DemodulatorKind,
    config: &Config,
    seed: u64,
) -> Result<ReferenceTable, Error> {
    let mut config = config.clone();
    config.drive.injection.demodulator = demodulator;
    let mut rig = Rig::oriented(&config, seed, 0.0, 0.0)?;
    // The table is an odd function of the current.
    let mut values = [0.0; POINTS];
    for n in 0..=LAST {
        rig.settle(&Command::Torque(Grid::REFERENCE.current(n)), SETTLE_S)?;
        let [signal] = rig.stats(AVERAGE_S, |p| [p.signal()]);
        if n > 0 {
            values[n..].fill(signal.mean() as f32);
        }
    }
    ReferenceTable::from_points(Grid::REFERENCE, values)
        .ok_or_else(|| Error::refused("a value of the reference is too large"))
}
