//! Settings of the current sensors and the converter, and their ranges.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Eq. 3.5, channel A and B: A per code, and the current of code zero in A.
const CALIBRATION: [(f64, f64); 2] = [(0.002_212_0, -4.472_713_4), (0.002_231_4, -4.496_623_8)];
/// Largest code of the source's converter.
pub(super) const FULL_SCALE: f64 = 4095.0;

/// Errors of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasurementSettings {
    /// Gaussian noise of each current channel, A rms.
    pub noise_a: f64,
    /// End of the range of channel A, A; B in proportion.
    pub range_a: f64,
    /// Current per code of channel A, A; B in proportion. A finer converter has more codes over the
    /// same range, up to 16 bits.
    pub lsb_a: f64,
    /// Corner of the analog filter, Hz (Eq. 3.3); 0 is none.
    pub filter_hz: f64,
    /// Relative gain error of channel A.
    pub gain_error_a: f64,
    /// Relative gain error of channel B.
    pub gain_error_b: f64,
    /// Offset of channel A, A.
    pub offset_a: f64,
    /// Offset of channel B, A.
    pub offset_b: f64,
    /// Share of the current of phase b that channel A reads as well.
    pub cross_talk_a: f64,
    /// Share of the current of phase a that channel B reads as well.
    pub cross_talk_b: f64,
    /// Further lag of channel B, first order, us.
    pub lag_b_us: f64,
    /// Relative error at the end of the range that grows with the square of the current.
    pub cubic_error: f64,
    /// Drift of the offset of channel A from the start on, A/s.
    pub drift_a: f64,
    /// Drift of the offset of channel B, A/s.
    pub drift_b: f64,
    /// Whether the code of a current is the sum of two conversions, in the middle of the period and at its end: in both zero
    /// vectors.
    pub both_zero_vectors: bool,
    /// Dc-link voltage per code, V (12 bits).
    pub dc_link_v: f64,
    /// Relative gain error of the dc-link voltage.
    pub dc_gain_error: f64,
    /// Lag of the dc-link voltage, first order, us.
    pub dc_lag_us: f64,
    /// Gaussian noise of the dc-link voltage, V rms.
    pub dc_noise_v: f64,
    /// Code of the heat-sink temperature.
    pub heat_sink_code: u16,
}

impl Default for MeasurementSettings {
    fn default() -> Self {
        Self::REFERENCE
    }
}

impl MeasurementSettings {
    /// The measurement of the reference board.
    const REFERENCE: Self = Self {
        noise_a: 0.005,
        range_a: -CALIBRATION[0].1,
        lsb_a: CALIBRATION[0].0,
        filter_hz: 5305.0,
        gain_error_a: 0.0,
        gain_error_b: 0.0,
        offset_a: 0.0,
        offset_b: 0.0,
        cross_talk_a: 0.0,
        cross_talk_b: 0.0,
        lag_b_us: 0.0,
        cubic_error: 0.0,
        drift_a: 0.0,
        drift_b: 0.0,
        both_zero_vectors: false,
        dc_link_v: 0.11,
        dc_gain_error: 0.0,
        dc_lag_us: 0.0,
        dc_noise_v: 0.0,
        heat_sink_code: 1309,
    };

    /// No noise, no filter, 16 bits.
    pub const IDEAL: Self =
        Self { noise_a: 0.0, lsb_a: 0.000_14, filter_hz: 0.0, ..Self::REFERENCE };

    /// Refuses what is outside its range.
    pub(super) fn check(&self) -> Result<(), PlantError> {
        let s = self;
        check("measurement.noise_a", s.noise_a, 0.0..=10.0, "A")?;
        check("measurement.range_a", s.range_a, 0.01..=5000.0, "A")?;
        // 7 to 16 bits, which the sum of two conversions has, too.
        let most = if s.both_zero_vectors { 16_000.0 } else { 32_000.0 };
        check("measurement.lsb_a", s.lsb_a, s.range_a / most..=s.range_a / 80.0, "A")?;
        check("measurement.filter_hz", s.filter_hz, 0.0..=1e6, "Hz")?;
        check("measurement.gain_error_a", s.gain_error_a, -0.5..=0.5, "")?;
        check("measurement.gain_error_b", s.gain_error_b, -0.5..=0.5, "")?;
        check("measurement.offset_a", s.offset_a, -5.0..=5.0, "A")?;
        check("measurement.offset_b", s.offset_b, -5.0..=5.0, "A")?;
        check("measurement.cross_talk_a", s.cross_talk_a, -0.2..=0.2, "")?;
        check("measurement.cross_talk_b", s.cross_talk_b, -0.2..=0.2, "")?;
        check("measurement.lag_b_us", s.lag_b_us, 0.0..=1000.0, "us")?;
        check("measurement.cubic_error", s.cubic_error, -0.3..=0.3, "")?;
        check("measurement.drift_a", s.drift_a, -1.0..=1.0, "A/s")?;
        check("measurement.drift_b", s.drift_b, -1.0..=1.0, "A/s")?;
        check("measurement.dc_link_v", s.dc_link_v, 0.001..=10.0, "V")?;
        check("measurement.dc_gain_error", s.dc_gain_error, -0.5..=0.5, "")?;
        check("measurement.dc_lag_us", s.dc_lag_us, 0.0..=1e5, "us")?;
        check("measurement.dc_noise_v", s.dc_noise_v, 0.0..=100.0, "V")?;
        Ok(())
    }

    /// The calibration of channels A and B without their gain and offset errors, as the drive is set.
    pub fn calibration(&self) -> [CalibrationLine; 2] {
        let wider = self.range_a / -CALIBRATION[0].1;
        let finer = wider * CALIBRATION[0].0 / self.lsb_a;
        CALIBRATION.map(|(a_per_code, a_at_zero)| CalibrationLine {
            a_per_code: wider * a_per_code / finer,
            a_at_zero: wider * a_at_zero,
            full_scale: (FULL_SCALE * finer).round() as u16,
        })
    }
}

/// Line of one current channel: `I = a_per_code n + a_at_zero`, Eq. 3.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationLine {
    /// Current per code, A.
    pub a_per_code: f64,
    /// Current at code zero, A.
    pub a_at_zero: f64,
    /// Largest code.
    pub full_scale: u16,
}
