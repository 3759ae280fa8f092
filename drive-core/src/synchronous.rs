//! Synchronous demodulation: the saliency the carrier sees, as a pure number.
//!
//! The sampled current is seen along and across the injection axis, both parts are mixed with the
//! carrier's own frequency and averaged twice over two carrier periods:
//!
//! ```text
//! X = MA20 MA20 ( 2 i_along e^(-j 2 pi k/10) )       Y likewise from i_across
//! q = -Re( Y conj(X) ) / |X|^2
//! ```
//!
//! which is what the channels of the dm-qm frame, A = (X - Y)/sqrt2 and B = (X + Y)/sqrt2, give as
//! ( |A|^2 - |B|^2 ) / |A + B|^2. Dividing by the part along the injection axis takes the amplitude of the injection, the dc link and
//! the leakage inductance out; taking magnitudes takes the phase of the carrier out. The averages have
//! their zeros at dc and at every multiple of 300 Hz, so the fundamental current, which leaks through
//! the printed band-pass, is gone. They delay `q` by 19 samples (3.2 ms).
//!
//! The averages are sums of integers, 2^-17 A a unit; see [`crate::moving_sum`].

use crate::demodulator::{CarrierSample, Demodulate};
use crate::injection::CARRIER_SAMPLES;
use crate::moving_sum::MovingSum;

/// Samples of one moving average: two carrier periods.
const LENGTH: usize = 2 * CARRIER_SAMPLES;
/// Units per ampere. The largest sum, 400 samples of 2 * 4.5 A * sqrt2, is 6.7e8.
const UNITS: f32 = 131_072.0;
/// Signals that are averaged: X and Y as complex numbers, and the reference current.
const SIGNALS: usize = 5;

/// State of the demodulation.
#[derive(Clone, Copy, Debug, Default)]
pub struct SynchronousState {
    index: usize,
    stages: [MovingSum<SIGNALS, LENGTH>; 2],
}

/// What the demodulation gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Saliency {
    /// The saliency `q`; 0 where there is no carrier.
    pub q: f32,
    /// Amplitude of the carrier current along the injection axis, squared, A^2.
    pub carrier_squared: f32,
    /// The reference current, delayed as `q` is, A.
    pub i_q: f32,
}

/// Sums over 400 samples that [`Saliency::of`] is made of.
pub type Sums = [i32; SIGNALS];

impl Demodulate for SynchronousState {
    type Seen = Saliency;

    #[inline]
    fn step(&mut self, sample: &CarrierSample) -> Saliency {
        Saliency::of(self.average(sample))
    }
}

impl SynchronousState {
    /// Mixes one sample and averages.
    #[inline]
    pub fn average(&mut self, sample: &CarrierSample) -> Sums {
        let (along, across) = sample.current.seen_from(sample.axis);
        let (along, across) = (along * (2.0 * UNITS), across * (2.0 * UNITS));
        let (c, s) = (sample.carrier.cos, sample.carrier.sin);
        // Saturating casts: not-a-number gives 0, and the drive finds it elsewhere.
        let mixed =
            [along * c, -along * s, across * c, -across * s, sample.i_q * UNITS].map(|x| x as i32);
        // Below 20 by construction: this is for a flipped bit.
        let index = if self.index < LENGTH { self.index } else { 0 };
        self.index = index + 1;
        let once = self.stages[0].step(index, mixed);
        self.stages[1].step(index, once)
    }
}

impl Saliency {
    /// What the averages tell.
    #[inline]
    pub fn of(twice: Sums) -> Self {
        const MEAN: f32 = 1.0 / (UNITS * (LENGTH * LENGTH) as f32);
        let [x_re, x_im, y_re, y_im, i_q] = twice.map(|x| x as f32 * MEAN);
        let squared = x_re * x_re + x_im * x_im;
        let product = x_re * y_re + x_im * y_im;
        Saliency {
            q: if squared > LEAST { -product / squared } else { 0.0 },
            carrier_squared: squared,
            i_q,
        }
    }
}

/// Square of the carrier current below which there is no saliency to speak of, A^2.
const LEAST: f32 = 5e-7;

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::angle::Angle;
    use crate::frames::AlphaBeta;
    use crate::injection::{CARRIER_COS, CARRIER_SIN, CarrierPeriod};
    use core::f64::consts::TAU;

    /// Sample `k` of a current, injected along `axis`.
    fn sample(current: AlphaBeta, axis: Angle, k: usize, i_q: f32) -> CarrierSample {
        let k = k % CARRIER_SAMPLES;
        let carrier =
            CarrierPeriod { cos: CARRIER_COS[k], sin: CARRIER_SIN[k], ..CarrierPeriod::default() };
        CarrierSample { current, axis: axis.unit_vector(), carrier, i_q }
    }

    /// Steady q for a carrier current of `amplitude` A in direction `turn` from the injection axis,
    /// on top of a fundamental of 3 A.
    fn steady(amplitude: f64, turn: f64, phase: f64) -> Saliency {
        let theta = 0.7;
        let axis = Angle::from_radians(theta as f32);
        let mut state = SynchronousState::default();
        let mut last = Saliency::default();
        for k in 0..500 {
            let carrier = amplitude * (TAU * f64::from(k) / 10.0 + phase).cos();
            let i = AlphaBeta::new(
                (carrier * (theta + turn).cos() + 2.0) as f32,
                (carrier * (theta + turn).sin() - 2.2) as f32,
            );
            last = state.step(&sample(i, axis, k as usize, 1.5));
        }
        last
    }

    #[test]
    fn q_is_the_turn_of_the_carrier_current_whatever_its_size_and_phase() {
        // A carrier turned by x from the axis has dm = cos(45° + x), qm = cos(45° - x) parts:
        // q = -sin(2x) / (2 cos^2 x) = -tan x.
        for (amplitude, phase) in [(0.26, 0.0), (0.26, 1.0), (0.05, 2.0), (0.5, -0.4)] {
            for x in [-0.1, -0.01, 0.0, 0.03] {
                let s = steady(amplitude, x, phase);
                assert!(
                    (f64::from(s.q) + x.tan()).abs() < 2e-4,
                    "{amplitude} {phase} {x}: {}",
                    s.q
                );
                let carrier = f64::from(s.carrier_squared).sqrt();
                assert!((carrier / (amplitude * x.cos()) - 1.0).abs() < 1e-3);
                assert!((s.i_q - 1.5).abs() < 1e-4);
            }
        }
    }

    #[test]
    fn the_sums_do_not_drift() {
        let (mut state, axis) = (SynchronousState::default(), Angle::ZERO);
        let mut x = 1_u32;
        for k in 0..600_000_usize {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (x >> 8) as f32 / 4e6 - 2.0;
            state.step(&sample(AlphaBeta::new(noise, -noise), axis, k, noise));
        }
        let mut rest = Saliency::default();
        for k in 0..40_usize {
            rest = state.step(&sample(AlphaBeta::ZERO, axis, k, 0.0));
        }
        assert_eq!(rest, Saliency::default());
    }

    #[test]
    fn no_carrier_and_no_number_do_no_harm() {
        assert_eq!(steady(0.0, 0.0, 0.0).q, 0.0);
        let mut state = SynchronousState::default();
        let nan = AlphaBeta::new(f32::NAN, f32::INFINITY);
        assert!(state.step(&sample(nan, Angle::ZERO, 77, f32::NAN)).q.is_finite());
    }
}
