//! Settings of the current sensors and the ADC, and their ranges.

use std::ops::RangeInclusive;

use crate::settings::settings;

/// Eq. 3.5, channels A and B: A per ADC count, and the current at zero counts in A.
const CALIBRATION: [(f64, f64); 2] = [(0.002_212_0, -4.472_713_4), (0.002_231_4, -4.496_623_8)];
/// Largest count of the source's ADC.
pub(super) const FULL_SCALE: f64 = 4095.0;

settings! {
    /// Errors of the measurement.
    MeasurementSettings "measurement." |s| {
        /// Gaussian noise of each current channel, A rms.
        noise_a: f64 = 0.005, 0.0..=10.0, "A";
        /// End of the range of channel A, A; channel B in proportion.
        range_a: f64 = -CALIBRATION[0].1, 0.01..=5000.0, "A";
        /// Current per ADC count of channel A, A; channel B in proportion. A finer ADC has more counts over the same
        /// range, up to 16 bits.
        lsb_a: f64 = CALIBRATION[0].0, s.lsb_range(), "A";
        /// Corner of the analog filter, Hz (Eq. 3.3); 0 for no filter.
        filter_hz: f64 = 5305.0, 0.0..=1e6, "Hz";
        /// Relative gain error of channel A.
        gain_error_a: f64 = 0.0, -0.5..=0.5, "";
        /// Relative gain error of channel B.
        gain_error_b: f64 = 0.0, -0.5..=0.5, "";
        /// Offset of channel A, A.
        offset_a: f64 = 0.0, -5.0..=5.0, "A";
        /// Offset of channel B, A.
        offset_b: f64 = 0.0, -5.0..=5.0, "A";
        /// Share of the current of phase b that channel A reads as well.
        cross_talk_a: f64 = 0.0, -0.2..=0.2, "";
        /// Share of the current of phase a that channel B reads as well.
        cross_talk_b: f64 = 0.0, -0.2..=0.2, "";
        /// Further lag of channel B, first order, us.
        lag_b_us: f64 = 0.0, 0.0..=1000.0, "us";
        /// Relative error at the end of the range; it grows with the square of the current.
        cubic_error: f64 = 0.0, -0.3..=0.3, "";
        /// Drift of the offset of channel A, from the start, A/s.
        drift_a: f64 = 0.0, -1.0..=1.0, "A/s";
        /// Drift of the offset of channel B, from the start, A/s.
        drift_b: f64 = 0.0, -1.0..=1.0, "A/s";
        /// Whether the ADC counts of a current are the sum of two conversions, one in each zero vector: in the middle
        /// of the period and at its end.
        both_zero_vectors: bool = false;
        /// Dc-link voltage per ADC count, V (12 bits).
        dc_link_v: f64 = 0.11, 0.001..=10.0, "V";
        /// Relative gain error of the dc-link voltage.
        dc_gain_error: f64 = 0.0, -0.5..=0.5, "";
        /// Lag of the dc-link voltage, first order, us.
        dc_lag_us: f64 = 0.0, 0.0..=1e5, "us";
        /// Gaussian noise of the dc-link voltage, V rms.
        dc_noise_v: f64 = 0.0, 0.0..=100.0, "V";
        /// ADC counts of the heat-sink temperature.
        heat_sink_code: u16 = 1309;
    }
}

impl MeasurementSettings {
    /// No noise, no filter, 16 bits.
    pub const IDEAL: Self = Self { noise_a: 0.0, lsb_a: 0.000_14, filter_hz: 0.0, ..Self::DEFAULT };

    /// Range of the current per count, for 7 to 16 bits; the sum of two conversions has the same range.
    fn lsb_range(&self) -> RangeInclusive<f64> {
        let most = if self.both_zero_vectors { 16_000.0 } else { 32_000.0 };
        self.range_a / most..=self.range_a / 80.0
    }

    /// Returns the calibration of channels A and B without their gain and offset errors, as the drive is set.
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
    /// Current per ADC count, A.
    pub a_per_code: f64,
    /// Current at zero counts, A.
    pub a_at_zero: f64,
    /// Largest count.
    pub full_scale: u16,
}
