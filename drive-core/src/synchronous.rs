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
//! The sums are integers (2^-17 A a unit): they hold their value for ever, where a running sum of
//! floats would drift.

use crate::angle::UnitVector;
use crate::frames::AlphaBeta;
use crate::injection::{CARRIER_SAMPLES, CarrierPeriod};

/// Samples of one moving average: two carrier periods.
const LENGTH: usize = 2 * CARRIER_SAMPLES;
/// Units per ampere. The largest sum, 400 samples of 2 * 4.5 A * sqrt2, is 6.7e8.
const UNITS: f32 = 131_072.0;
/// Signals that are averaged: X and Y as complex numbers, and the reference current.
const SIGNALS: usize = 5;

/// One moving average of all signals.
#[derive(Clone, Copy, Debug)]
struct MovingSum {
    ring: [[i32; SIGNALS]; LENGTH],
    sum: [i32; SIGNALS],
}

impl MovingSum {
    /// Takes the newest values in at place `index` < 20 of the ring; the sum of the last 20.
    fn step(&mut self, index: usize, new: [i32; SIGNALS]) -> [i32; SIGNALS] {
        let slot = &mut self.ring[index];
        for ((sum, old), new) in self.sum.iter_mut().zip(slot.iter()).zip(new) {
            // Wrapping sums are exact as long as the true sum fits, which it does.
            *sum = sum.wrapping_add(new).wrapping_sub(*old);
        }
        *slot = new;
        self.sum
    }
}

/// State of the demodulation.
#[derive(Clone, Copy, Debug)]
pub struct SynchronousState {
    index: usize,
    stages: [MovingSum; 2],
}

impl Default for SynchronousState {
    fn default() -> Self {
        let empty = MovingSum { ring: [[0; SIGNALS]; LENGTH], sum: [0; SIGNALS] };
        Self { index: 0, stages: [empty; 2] }
    }
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

impl SynchronousState {
    /// One sample: the current in A; the injection axis `e^(j theta)`, delayed as the current is; the
    /// carrier; the reference of the quadrature current, A.
    #[inline]
    pub fn step(
        &mut self,
        current: AlphaBeta,
        axis: UnitVector,
        carrier: CarrierPeriod,
        i_q: f32,
    ) -> Saliency {
        let (along, across) = current.seen_from(axis);
        let (along, across) = (along * (2.0 * UNITS), across * (2.0 * UNITS));
        let (c, s) = (carrier.cos, carrier.sin);
        // Saturating casts: not-a-number gives 0, and the drive finds it elsewhere.
        let mixed = [along * c, -along * s, across * c, -across * s, i_q * UNITS].map(|x| x as i32);
        // Below 20 by construction: this is for a flipped bit.
        let index = if self.index < LENGTH { self.index } else { 0 };
        self.index = index + 1;
        let once = self.stages[0].step(index, mixed);
        let twice = self.stages[1].step(index, once);

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
    use crate::injection::{CARRIER_COS, CARRIER_SIN};
    use core::f64::consts::TAU;

    fn carrier(k: usize) -> CarrierPeriod {
        let k = k % CARRIER_SAMPLES;
        CarrierPeriod { cos: CARRIER_COS[k], sin: CARRIER_SIN[k], ..CarrierPeriod::default() }
    }

    /// Steady q for a carrier current of `amplitude` A in direction `turn` from the injection axis,
    /// on top of a fundamental of 3 A.
    fn steady(amplitude: f64, turn: f64, phase: f64) -> Saliency {
        let theta = 0.7;
        let axis = Angle::from_radians(theta as f32).unit_vector();
        let mut state = SynchronousState::default();
        let mut last = Saliency::default();
        for k in 0..500 {
            let carrier = amplitude * (TAU * f64::from(k) / 10.0 + phase).cos();
            let i = AlphaBeta::new(
                (carrier * (theta + turn).cos() + 2.0) as f32,
                (carrier * (theta + turn).sin() - 2.2) as f32,
            );
            last = state.step(i, axis, self::carrier(k as usize), 1.5);
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
        let (mut state, axis) = (SynchronousState::default(), Angle::ZERO.unit_vector());
        let mut x = 1_u32;
        for k in 0..600_000_usize {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (x >> 8) as f32 / 4e6 - 2.0;
            state.step(AlphaBeta::new(noise, -noise), axis, carrier(k), noise);
        }
        let mut rest = Saliency::default();
        for k in 0..40_usize {
            rest = state.step(AlphaBeta::ZERO, axis, carrier(k), 0.0);
        }
        assert_eq!(rest, Saliency::default());
    }

    #[test]
    fn no_carrier_and_no_number_do_no_harm() {
        assert_eq!(steady(0.0, 0.0, 0.0).q, 0.0);
        let mut state = SynchronousState::default();
        let nan = AlphaBeta::new(f32::NAN, f32::INFINITY);
        assert!(state.step(nan, Angle::ZERO.unit_vector(), carrier(77), f32::NAN).q.is_finite());
    }
}
