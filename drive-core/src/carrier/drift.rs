//! Drift of the gains of the current sensors since the learning.
//!
//! A gain mismatch m that was not there while the drive learned makes the carrier current swing with twice the angle theta of
//! the injection axis, by [`Asymmetry`]:
//!
//! ```text
//! |C|^2 / |C|_ref^2 = 1 + m h        h = cos 2 theta + sin 2 theta / sqrt3
//! ```
//!
//! While the flux turns, m follows this ratio by least mean squares with a time constant of 2 s; the mean of the ratio over
//! 1 s is taken out first, so that a load or an error of the angle does not count. The drift that was found is taken out of the
//! demodulated signals together with the learned asymmetry.
//!
//! At standstill of the flux h is a constant, and m h cannot be told from any other change of the ratio: m keeps the value that
//! was found while the flux turned. Whether it turns is judged by the mean frequency over 0.5 s, which is the angle turned in
//! that time: 36° are asked for. The noise of the angle is some 10°, but that of the frequency exceeds any limit now and then.
//!
//! A mismatch of 1 % that came after the learning costs 6.9° rms without this, 4.1° to 4.6° with it, by its sign (family `r`, runs of
//! 2 to 6 s from the start on).

use crate::carrier::asymmetry::Asymmetry;
use crate::carrier::injection::CARRIER_S;
use crate::math::limited;
use crate::{PERIOD_S, UnitVector};

/// Asymmetry per mismatch.
const GAINS: Asymmetry = Asymmetry::of_gain_mismatch(1.0);
/// Largest drift that is followed, and the same per slope of the saliency, 1/rad: a wrong angle, too, makes |C| swing, and what
/// is taken for a drift is hidden from the lock monitor, whose unit is the slope.
const LARGEST: f32 = 0.015;
const LARGEST_PER_SLOPE: f32 = 0.25;
/// Least frequency of the flux, electrical turns per period: 0.2 Hz, at the sample and in the mean.
const LEAST_FREQ: f32 = 0.2 * PERIOD_S;
/// Largest mean frequency that is remembered: a flux that stops is noticed within 0.2 s.
const LARGEST_MEAN_FREQ: f32 = 1.5 * LEAST_FREQ;
/// Shares of the newest value in the means of the ratio, 1 s, and of the frequency, 0.5 s.
const MEAN_SHARE: f32 = CARRIER_S;
const FREQ_SHARE: f32 = CARRIER_S / 0.5;
/// Step of m per deviation: 2 s, with a mean of h^2 of 2/3.
const STEP: f32 = CARRIER_S / (2.0 * 2.0 / 3.0);

/// State of the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GainDrift {
    /// Asymmetry beyond the learned one that this start and the runs before have found.
    pub at_start: Asymmetry,
    /// The mismatch m.
    pub mismatch: f32,
    /// Mean deviation of the ratio from 1.
    mean: f32,
    /// Mean frequency of the flux, electrical turns per period.
    mean_freq: f32,
    /// The factor h of the latest saliency.
    h: f32,
}

impl GainDrift {
    /// No drift since a start that has measured this asymmetry beyond the learned one.
    pub fn new(at_start: Asymmetry) -> Self {
        Self { at_start, ..Self::default() }
    }

    /// `learned` with the drift, for a saliency that was seen with the injection along `axis`.
    pub fn on_top_of(&mut self, learned: &Asymmetry, axis: UnitVector) -> Asymmetry {
        self.h = 2.0 * GAINS.along(axis.turned_by(axis));
        learned.plus(&self.all(), 1.0)
    }

    /// The largest drift that is followed with this slope without torque current, 1/rad.
    pub fn largest(slope_at_rest: f32) -> f32 {
        limited(LARGEST_PER_SLOPE * slope_at_rest.abs(), LARGEST)
    }

    /// Takes the deviation of the ratio from 1 of the latest saliency, which this drift was taken out of. `flux_freq` is the
    /// frequency of the flux, electrical turns per period; the drift stays within `largest`.
    pub fn step(&mut self, deviation: f32, flux_freq: f32, largest: f32) {
        let freq = self.mean_freq + FREQ_SHARE * (flux_freq - self.mean_freq);
        self.mean_freq = limited(freq, LARGEST_MEAN_FREQ);
        // The ratio of a flux that stands is no part of the mean: it contains the drift at one angle.
        if flux_freq.abs() >= LEAST_FREQ && self.mean_freq.abs() >= LEAST_FREQ {
            let rest = deviation - self.mean;
            self.mean += MEAN_SHARE * rest;
            self.mismatch = limited(self.mismatch + STEP * self.h * rest, largest);
        }
    }

    /// All asymmetry beyond the learned one.
    pub fn all(&self) -> Asymmetry {
        self.at_start.plus(&GAINS, self.mismatch)
    }

    /// The carrier current squared across phase a, where a start measures |C|_ref, relative to that without drift.
    pub fn across_a(&self) -> f32 {
        1.0 - self.mismatch
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::Angle;
    use crate::carrier::Saliency;
    use core::f64::consts::TAU;

    /// The estimate after `seconds` of a flux at `hz`, with sensors whose gains differ by `mismatch` and a ratio that is
    /// off by `loss` beside. The sensors are those of the definition, in double precision.
    fn followed(mismatch: f64, loss: f64, hz: f64, seconds: f64) -> GainDrift {
        followed_from(0.0, mismatch, loss, hz, seconds)
    }

    /// The same after `standing` seconds of a flux that stands.
    fn followed_from(standing: f64, mismatch: f64, loss: f64, hz: f64, seconds: f64) -> GainDrift {
        let mut drift = GainDrift::default();
        // The reference was taken across phase a.
        let along = |theta: f64| {
            let (a, b) = (1.0 + 0.5 * mismatch, 1.0 - 0.5 * mismatch);
            let (i_a, i_b) = (a * theta.cos(), b * (theta - TAU / 3.0).cos());
            i_a * theta.cos() + (i_a + 2.0 * i_b) / 3.0_f64.sqrt() * theta.sin()
        };
        let reference = along(TAU / 4.0).powi(2);
        for n in 0..(600.0 * (standing + seconds)) as u32 {
            let turning = f64::from(n) / 600.0 - standing;
            let (hz, turned) = if turning < 0.0 { (0.0, 0.0) } else { (hz, hz * turning) };
            let theta = TAU / 4.0 + TAU * turned;
            let axis = Angle::from_turns((theta / TAU % 1.0) as f32).unit_vector();
            let square = along(theta).powi(2) / reference + loss;
            let mut seen = Saliency { q: 0.0, carrier_squared: square as f32, i_q: 0.0 };
            drift.on_top_of(&Asymmetry::default(), axis).take_out(&mut seen, axis);
            drift.step(
                seen.carrier_squared * drift.across_a() - 1.0,
                (hz / 6000.0) as f32,
                LARGEST,
            );
        }
        drift
    }

    #[test]
    fn the_mismatch_is_found_while_the_flux_turns() {
        for (mismatch, loss, hz) in [
            (0.01, 0.0, 1.0),
            (-0.01, 0.0, -10.0),
            (0.005, 0.02, 0.5),
            (-0.004, -0.02, 3.0),
            (0.0, 0.02, 2.0),
        ] {
            let found = f64::from(followed(mismatch, loss, hz, 10.0).mismatch);
            // After five time constants 0.7 % of it are left, and the ripple of the mean of a loss that came at once.
            assert!((found - mismatch).abs() < 4e-4, "{mismatch} {loss} {hz}: {found}");
        }
        // 63 % after the time constant, also from standstill with a loss.
        for (standing, loss) in [(0.0, 0.0), (5.0, 0.0), (5.0, 0.02)] {
            let found = f64::from(followed_from(standing, 0.01, loss, 5.0, 2.0).mismatch);
            assert!((found / 0.01 - 0.63).abs() < 0.05, "{standing} s: {found}");
        }
    }

    /// Torque at zero stator frequency for ten minutes. The loop of the angle passes noise up to 4 Hz, 1.5° of it, so that the
    /// frequency exceeds [`LEAST_FREQ`] in some samples. A warm rotor makes a loss that is constant, and one in proportion to the
    /// angle.
    #[test]
    fn at_zero_stator_frequency_noise_is_taken_for_no_turning() {
        let (corner, angle_rms) = (TAU * 4.0 / 600.0, 1.5_f64.to_radians());
        for (degrees, loss) in [(0.0, 0.02), (30.0, -0.02), (75.0, 0.0035), (120.0, 0.02)] {
            let (mut drift, mut seed, mut exceeded) = (GainDrift::default(), 1_u32, 0);
            let (mut low, mut angle) = (0.0_f64, 0.0_f64);
            for _ in 0..600 * 600 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                // Uniform, of variance 1; a second-order low-pass of it has the variance corner/4.
                let white = 12.0_f64.sqrt() * (f64::from(seed >> 8) / f64::from(1 << 24) - 0.5);
                low += corner * (white - low);
                let before = angle;
                angle += corner * (low - angle);
                let scale = angle_rms / (corner / 4.0).sqrt();
                let flux_freq = scale * (angle - before) / TAU / 10.0;
                exceeded += u32::from(flux_freq.abs() > f64::from(LEAST_FREQ));
                let theta = (degrees + 90.0_f64).to_radians() + scale * angle;
                let axis = Angle::from_turns((theta / TAU % 1.0) as f32).unit_vector();
                let deviation = loss * (1.0 + 2.0 * scale * angle);
                let mut seen =
                    Saliency { q: 0.0, carrier_squared: 1.0 + deviation as f32, i_q: 0.0 };
                drift.on_top_of(&Asymmetry::default(), axis).take_out(&mut seen, axis);
                let deviation = seen.carrier_squared * drift.across_a() - 1.0;
                drift.step(deviation, flux_freq as f32, LARGEST);
                assert!(drift.mismatch.abs() < 0.001, "{degrees} {loss}: {}", drift.mismatch);
            }
            assert!((360..36_000).contains(&exceeded), "{exceeded} of 360 000 samples");
        }
    }

    /// A flux that stops is not taken for a turning one, whatever the loss does then.
    #[test]
    fn a_drift_that_was_found_is_kept_at_standstill() {
        let mut drift = followed(0.01, 0.0, 5.0, 10.0);
        let found = drift.mismatch;
        let axis = UnitVector { cos: 0.0, sin: 1.0 };
        for n in 0..600 * 60 {
            drift.on_top_of(&Asymmetry::default(), axis);
            // The noise exceeds the least frequency in one sample of thirty.
            let freq = if n % 30 == 0 { 2.0 * LEAST_FREQ } else { 0.0 };
            drift.step(0.02, freq, LARGEST);
        }
        assert!((drift.mismatch - found).abs() < 0.001, "{found} {}", drift.mismatch);
    }

    #[test]
    fn standstill_shows_nothing_and_it_stays_within_its_limit() {
        assert_eq!(followed(0.01, 0.02, 0.1, 5.0).mismatch, 0.0);
        assert_eq!(followed(0.05, 0.0, 2.0, 20.0).mismatch, LARGEST);
        assert_eq!(followed(-0.05, 0.0, 2.0, 20.0).mismatch, -LARGEST);
    }
}
