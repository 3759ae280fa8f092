//! The reference voltage of the ADCs, which the scales of the sensors follow.

use drive_core::Line;

/// Reference voltage of the ADCs, V: VREF+ of the Nucleo board is its 3.3 V supply.
pub const REFERENCE_V: f32 = 3.3;
/// ADC counts of the full range: 12 bits.
pub const CODES: u16 = 4096;
/// Reference voltage of the ADC with which the dissertation's sensors were calibrated, V (Eq. 3.4).
const CALIBRATION_REFERENCE_V: f32 = 3.0;

/// The calibration line of a sensor of the dissertation at [`REFERENCE_V`].
pub const fn calibrated(line: Line) -> Line {
    // With a higher reference the same voltage gives a smaller count; count 0 stays 0 V.
    Line { gain: line.gain * (REFERENCE_V / CALIBRATION_REFERENCE_V), ..line }
}
