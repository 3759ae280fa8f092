//! The PII controller of the dissertation, Eq. 3.7 / 3.44, which rotates the injection axis until `delta_i` equals its reference:
//! `u[k+1] = 2 u[k] - u[k-1] + k_s (e[k] - z_s e[k-1])`, written as two accumulators: the frequency, and
//! the angle, which wraps. Two integrators follow a flux of constant speed without steady-state error.

use core::f32::consts::TAU;

use crate::Angle;
use crate::flux::Axis;

/// Coefficients of the PII tracker.
///
/// ```
/// use induction_drive_core::{flux::Axis, printed::Tracker};
///
/// // The gains of section 3.11; at most 600 Hz at 6 kHz.
/// let tracker = Tracker::new(0.132_546, 0.9, 0.1);
/// let (mut axis, mut before) = (Axis::default(), 0.0);
/// // A steady error of 1 mA turns the axis faster and faster: two integrators.
/// let turned: Vec<f32> = (0..30).map(|_| { assert!(tracker.step(&mut axis, &mut before, 1e-3)); axis.freq }).collect();
/// assert!(turned.windows(2).all(|pair| pair[1] > pair[0]));
/// // Without an error it keeps the frequency that it has.
/// let freq = { tracker.step(&mut axis, &mut before, 0.0); axis.freq };
/// tracker.step(&mut axis, &mut before, 0.0);
/// assert_eq!(axis.freq, freq);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracker {
    /// Gain, turns per period and ampere.
    gain: f32,
    /// Zero.
    zero: f32,
    /// Largest frequency, turns per period.
    limit: f32,
}

impl Tracker {
    /// Creates a tracker with gain `k_s`, rad/A, and zero `z_s` of Eq. 3.44; `limit` is the largest
    /// frequency, electrical turns per period, below 1/2.
    pub fn new(k_s: f32, z_s: f32, limit: f32) -> Self {
        Self { gain: k_s / TAU, zero: z_s, limit }
    }

    /// Advances the axis by one period with `error` = reference - `delta_i`, A, after the error `before` of the previous period. Returns
    /// false when the frequency has reached its limit or is NaN, which means that the angle is lost.
    pub fn step(&self, axis: &mut Axis, before: &mut f32, error: f32) -> bool {
        let freq = axis.freq + self.gain * (error - self.zero * *before);
        *before = error;
        axis.freq = freq;
        axis.angle += Angle::within_turn(freq);
        freq < self.limit && freq > -self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_equation_3_44() {
        let (k_s, z_s) = (0.132_546, 0.9);
        let tracker = Tracker::new(k_s as f32, z_s as f32, 0.1);
        let (mut axis, mut before) = (Axis::default(), 0.0);
        let (mut u, mut last, mut e1) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..200 {
            let e = 0.01 * f64::from(k % 7) - 0.02;
            assert!(tracker.step(&mut axis, &mut before, e as f32));
            let next = 2.0 * u - last + k_s * (e - z_s * e1);
            (last, u, e1) = (u, next, e);
        }
        let turns = u / core::f64::consts::TAU;
        let difference = f64::from((axis.angle - Angle::from_turns(turns as f32)).to_turns());
        assert!(difference.abs() < 1e-5, "{difference}");
    }

    #[test]
    fn says_when_it_runs_away() {
        let tracker = Tracker::new(0.13, 0.9, 0.01);
        let (mut axis, mut before) = (Axis::default(), 0.0);
        assert!((0..100_000).any(|_| !tracker.step(&mut axis, &mut before, 1.0)));
        assert!(!tracker.step(&mut Axis::default(), &mut 0.0, f32::NAN));
    }

    #[test]
    fn the_limit_holds_both_ways() {
        let step = |freq: f32| {
            let mut axis = Axis { freq, ..Axis::default() };
            Tracker::new(0.13, 0.9, 0.01).step(&mut axis, &mut 0.0, 0.0)
        };
        assert!(step(0.0099) && step(-0.0099) && !step(0.0101) && !step(-0.0101));
    }

    #[test]
    fn the_zero_keeps_the_frequency() {
        let tracker = Tracker::new(0.01 * TAU, 0.5, 0.1);
        let (mut axis, mut before) = (Axis::default(), 0.0);
        assert!(tracker.step(&mut axis, &mut before, 1.0)); // one ampere: 0.01 turns per period
        assert!((axis.freq - 0.01).abs() < 1e-7 && (axis.angle.to_turns() - 0.01).abs() < 1e-7);
        assert!(tracker.step(&mut axis, &mut before, 0.5)); // e[k] = z_s e[k-1]: the frequency is kept
        assert!((axis.freq - 0.01).abs() < 1e-7 && (axis.angle.to_turns() - 0.02).abs() < 1e-7);
        assert!(!tracker.step(&mut axis, &mut before, 100.0)); // beyond the speed limit: the angle is lost
    }
}
