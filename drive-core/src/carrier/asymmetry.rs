//! Asymmetry of sensors and stator: the part of the injection current that rotates against the injection axis.
//!
//! If the voltage is injected along `e^(j theta)`, a motor or sensors that are not symmetric in the stator frame add
//! `n e^(-j theta)` to the injection current, with a complex number `n`. Its causes are a gain mismatch, cross-talk from
//! one channel to the other, and a saliency fixed to the stator. The first two also turn the whole current by a constant
//! angle. Along and across the injection axis, relative to the injection current,
//!
//! ```text
//! q_n = constant + sin sin 2 theta + cos cos 2 theta              |C| = 1 + sin cos 2 theta - cos sin 2 theta
//! ```
//!
//! with `sin = Re n` and `cos = -Im n`. The three numbers are [learned](crate::identify::learning) and subtracted. A change of `n`
//! [is followed](Asymmetry::follow) in `|C|` while the frame rotates.
//! (Products with the saliency of the flux are of second order and neglected.)

use crate::carrier::{CARRIER_SAMPLES, Saliency};
use crate::math::limited;
use crate::{PERIOD_S, SQRT_3, UnitVector};

/// Control periods from one call of [`Asymmetry::follow`] to the next.
const EVERY: f32 = 2.0 * CARRIER_SAMPLES as f32;
/// Turns of the doubled angle, and least time, s, in which a change is followed. With a third of them, the noise costs 0.2 degrees rms on
/// `m4b` and 1.6 on `g7` with low flux.
const TURNS: f32 = 3.0;
const LEAST_S: f32 = 0.9;

/// The learned numbers, dimensionless; 0 without an asymmetry.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Asymmetry {
    /// Part of q that does not change with the angle.
    pub constant: f32,
    /// Part of q in phase with sin 2 theta.
    pub sin: f32,
    /// Part of q in phase with cos 2 theta.
    pub cos: f32,
}

impl Asymmetry {
    /// Largest accepted asymmetry: a gain mismatch of 10 % has 0.083.
    pub(crate) const LARGEST: f32 = 0.1;

    /// Returns the asymmetry caused by a gain of sensor a that is higher by `mismatch`/2 and a gain of sensor b that is lower by
    /// the same amount.
    pub const fn of_gain_mismatch(mismatch: f32) -> Self {
        let d = 0.5 * mismatch;
        Self { constant: -d / SQRT_3, sin: d, cos: -d / SQRT_3 }
    }

    /// Returns the gain mismatch that explains most of these numbers, by least squares.
    pub fn gain_mismatch(&self) -> f32 {
        1.2 * (self.sin - (self.cos + self.constant) / SQRT_3)
    }

    /// Returns the sum of this asymmetry and a `share` of the other.
    pub fn plus(&self, other: &Self, share: f32) -> Self {
        Self {
            constant: self.constant + share * other.constant,
            sin: self.sin + share * other.sin,
            cos: self.cos + share * other.cos,
        }
    }

    /// Returns the root of the sum of the squares.
    pub fn size(&self) -> f32 {
        let Self { constant, sin, cos } = self;
        fpu_sqrt::sqrtf(constant * constant + sin * sin + cos * cos)
    }

    /// Removes the asymmetry from a saliency that was measured with the injection along `axis`.
    pub fn take_out(&self, saliency: &mut Saliency, axis: UnitVector) {
        let twice = axis.turned_by(axis);
        saliency.q -= self.constant + self.sin * twice.sin + self.cos * twice.cos;
        saliency.carrier_squared *= 1.0 - 2.0 * self.along(twice);
    }

    /// Follows a change of the asymmetry by its effect along the injection axis; called once in two injection periods. `beyond` is the
    /// squared injection current less its mean, divided by the expected one. It was measured with the injection along `axis`, which
    /// rotates at `freq`, electrical turns per control period. If the axis does not rotate, this effect cannot be told from that of the
    /// flux, and nothing changes.
    pub fn follow(&mut self, beyond: f32, axis: UnitVector, freq: f32) {
        let twice = axis.turned_by(axis);
        let step = beyond * limited(2.0 / TURNS * EVERY * freq.abs(), EVERY * PERIOD_S / LEAST_S);
        let (sin, cos) = (step * twice.cos, -step * twice.sin);
        // That of the gain mismatch that explains most of both, by least squares.
        let constant = 0.25 * cos - 0.75 / SQRT_3 * sin;
        let changed = self.plus(&Self { constant, sin, cos }, 1.0);
        if changed.size() <= Self::LARGEST {
            *self = changed;
        }
    }

    /// Returns the part of the asymmetry in the relative injection current along the injection axis, whose doubled angle is
    /// `twice`.
    pub(crate) fn along(&self, twice: UnitVector) -> f32 {
        self.sin * twice.cos - self.cos * twice.sin
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::Angle;

    /// Returns the injection current along the axis and the saliency across it, relative to the ideal current, for a
    /// current `e^(j theta)` that both sensors and the stator distort: `i_a` becomes `a i_a + x i_b`, `i_b` becomes
    /// `b i_b`.
    fn seen(theta: f64, a: f64, b: f64, x: f64) -> (f64, f64) {
        let (i_a, i_b) = (theta.cos(), (theta - core::f64::consts::TAU / 3.0).cos());
        let (m_a, m_b) = (a * i_a + x * i_b, b * i_b);
        let (alpha, beta) = (m_a, (m_a + 2.0 * m_b) / 3.0_f64.sqrt());
        (alpha * theta.cos() + beta * theta.sin(), -(beta * theta.cos() - alpha * theta.sin()))
    }

    /// A change shows in the injection current of an axis that rotates. The constant part is that of the nearest gain mismatch, and the
    /// mismatch of the gains is found whole. An axis that stands shows nothing.
    #[test]
    fn a_change_is_followed_while_the_axis_rotates() {
        let rest = |change: &Asymmetry, hz: f64, seconds: f64| {
            let mut found = Asymmetry::default();
            for n in 0..(300.0 * seconds) as u32 {
                let turns = (0.1 + hz * f64::from(n) / 300.0).fract();
                let axis = Angle::from_turns(turns as f32).unit_vector();
                let rest = change.plus(&found, -1.0);
                let beyond = 2.0 * rest.along(axis.turned_by(axis));
                found.follow(beyond, axis, (hz / 6000.0) as f32);
            }
            change.plus(&found, -1.0)
        };
        for hz in [0.5, -2.0, 10.0, 100.0] {
            // Four time constants.
            let seconds = 4.0 * f64::max(1.5 / f64::abs(hz), 0.9);
            for mismatch in [0.01, -0.02] {
                let change = Asymmetry::of_gain_mismatch(mismatch);
                let left = rest(&change, hz, seconds);
                assert!(left.size() < 0.05 * change.size(), "{hz} Hz: {left:?}");
            }
            // A saliency of the stator.
            let change = Asymmetry { constant: 0.0, sin: 0.002, cos: 0.004 };
            let left = rest(&change, hz, seconds);
            assert!(left.sin.hypot(left.cos) < 0.05 * change.size(), "{hz} Hz: {left:?}");
            assert!(left.constant.abs() < 0.5 * change.size(), "{hz} Hz: {left:?}");
        }
        let change = Asymmetry::of_gain_mismatch(0.01);
        assert_eq!(rest(&change, 0.0, 1.0), change);
    }

    #[test]
    fn sensors_that_differ_are_taken_out_at_every_angle() {
        // The numbers of each error are computed independently, by the mean over a turn.
        for (a, b, x) in [(1.01, 0.99, 0.0), (1.0, 1.0, 0.01), (0.997, 1.004, -0.02)] {
            let mut found = [0.0_f64; 3];
            let angles = (0..720).map(|n| f64::from(n) * core::f64::consts::TAU / 720.0);
            for theta in angles.clone() {
                let (_, q) = seen(theta, a, b, x);
                let parts = [1.0, 2.0 * (2.0 * theta).sin(), 2.0 * (2.0 * theta).cos()];
                found.iter_mut().zip(parts).for_each(|(sum, part)| *sum += q * part / 720.0);
            }
            let [constant, sin, cos] = found.map(|x| x as f32);
            let asymmetry = Asymmetry { constant, sin, cos };
            if x == 0.0 {
                assert!((asymmetry.gain_mismatch() - (a - b) as f32).abs() < 1e-4);
                let rest = asymmetry.plus(&Asymmetry::of_gain_mismatch(0.02), -1.0);
                assert!(rest.size() < 1e-4, "{rest:?}");
            }
            // Without asymmetry the injection current is constant; its mean over the angles is common to both sensors.
            let mean = angles.clone().map(|theta| seen(theta, a, b, x).0).sum::<f64>() / 720.0;
            for theta in angles {
                let (along, q) = seen(theta, a, b, x);
                let mut saliency = Saliency {
                    q: q as f32,
                    carrier_squared: (along * along / (mean * mean)) as f32,
                    i_q: 0.0,
                };
                let axis = Angle::from_turns((theta / core::f64::consts::TAU) as f32);
                asymmetry.take_out(&mut saliency, axis.unit_vector());
                // The rest is of second order, the square of 2 %.
                assert!(saliency.q.abs() < 2e-5, "{a} {b} {x} {theta}: {saliency:?}");
                assert!((saliency.carrier_squared - 1.0).abs() < 2e-3, "{theta}: {saliency:?}");
            }
        }
    }
}
