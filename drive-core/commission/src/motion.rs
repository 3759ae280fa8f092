//! Sums over the motion of a free shaft under a torque, and after an impulse of torque; [`inertia`](super::inertia) has the
//! equations.

use core::mem::replace;

use drive_core::{PERIOD_S, limited};

/// Control periods from one pair of values to the next: 10 ms. The speed is a mean over the same time and smoothed over 5
/// ms, so it belongs to the integrals of the pair before.
const EVERY: u16 = 60;
/// Pairs after a change of the current that do not count, 0.03 s, while the estimated speed follows.
const SETTLING: u16 = 3;
/// Speed from which on its direction counts in full, electrical rad/s: 10 rpm of four poles.
const MOVES_RAD_PER_S: f32 = 2.094;

/// Control periods from one speed to the next after an impulse: an injection period. The estimate does not change within one.
const RINGING_EVERY: u16 = 10;
/// Speeds after the impulse that do not count, 0.1 s, while the estimated speed follows.
const RINGING_FROM: usize = 60;
/// Speeds from one to the one that it is compared with.
const LAG: usize = 5;

/// Sums over integrals and speed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    /// Integral of i_q, A s, and of the direction, s: now, and at the last pair.
    x: f32,
    f: f32,
    earlier: (f32, f32),
    /// Sum of the speed since the last pair.
    speed: f32,
    periods: u16,
    /// Q-axis current, A, and number of pairs since it changed.
    i_q: f32,
    settled: u16,
    /// Sums over the pairs of 1, w, x, f, w w, x x, f f, x w, f w, x f.
    sums: [f32; 10],
}

/// Result of the sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Slope {
    /// Speed per integral of the current, electrical rad/s per A s.
    pub value: f32,
    /// Deceleration by friction, electrical rad/s^2.
    pub friction: f32,
    /// Share of the variance of the speed that is explained.
    pub explained: f32,
}

impl Motion {
    /// Takes a control period: the q-axis current reference, A, and the speed, electrical turns per period.
    pub fn push(&mut self, i_q: f32, rotor_freq: f32) {
        self.x += PERIOD_S * i_q;
        self.speed += rotor_freq;
        self.periods += 1;
        if self.periods < EVERY {
            return;
        }
        let w = self.speed * (core::f32::consts::TAU / (PERIOD_S * f32::from(EVERY)));
        (self.periods, self.speed) = (0, 0.0);
        self.f += PERIOD_S * f32::from(EVERY) * limited(w * (1.0 / MOVES_RAD_PER_S), 1.0);
        let (x, f) = replace(&mut self.earlier, (self.x, self.f));
        let moved = (i_q - replace(&mut self.i_q, i_q)).abs() > 0.01 * i_q.abs();
        self.settled = if moved { 0 } else { self.settled.saturating_add(1) };
        if self.settled >= SETTLING {
            let terms = [1.0, w, x, f, w * w, x * x, f * f, x * w, f * w, x * f];
            self.sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
    }

    /// Returns the slopes by least squares.
    pub fn slope(&self) -> Slope {
        let [count, w, x, f, ww, xx, ff, xw, fw, xf] = self.sums;
        let centred = |sum: f32, one: f32, other: f32| sum - one * other / count;
        let (ww, xx, ff) = (centred(ww, w, w), centred(xx, x, x), centred(ff, f, f));
        let (xw, fw, xf) = (centred(xw, x, w), centred(fw, f, w), centred(xf, x, f));
        let per_determinant = 1.0 / (xx * ff - xf * xf);
        let value = (xw * ff - fw * xf) * per_determinant;
        let friction = (xw * xf - fw * xx) * per_determinant;
        Slope { value, friction, explained: (value * xw - friction * fw) / ww }
    }
}

/// Sums over the speed of a shaft after an impulse of torque: how much it changes in [`LAG`] injection periods. In a change over 8 ms an
/// oscillation between 15 and 60 Hz is as large as in the speed itself, or larger, but the deceleration by friction is not.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ringing {
    periods: u16,
    /// The last speeds, electrical rad/s, and the number of speeds.
    last: [f32; LAG],
    seen: usize,
    /// Number of the changes, their sum and that of their squares.
    sums: [f32; 3],
}

impl Ringing {
    /// Takes a control period: the speed, electrical turns per period.
    pub fn push(&mut self, rotor_freq: f32) {
        self.periods = (self.periods + 1) % RINGING_EVERY;
        if self.periods > 0 {
            return;
        }
        let w = rotor_freq * (core::f32::consts::TAU / PERIOD_S);
        let change = w - replace(&mut self.last[self.seen % LAG], w);
        self.seen += 1;
        if self.seen > RINGING_FROM {
            let terms = [1.0, change, change * change];
            self.sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
    }

    /// Returns the standard deviation of the change, electrical rad/s.
    pub fn deviation(&self) -> f32 {
        let [n, sum, squares] = self.sums;
        fpu_sqrt::sqrtf((squares - sum * sum / n) / n)
    }
}
