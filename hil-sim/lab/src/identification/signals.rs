//! Voltages that excite a machine, measurement noise, and the filters before the estimation (sections 4 and 5).

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use rand::{Rng, RngExt};

use super::Complex;

/// Tones of the Schroeder signal.
pub const TONES: u32 = 5;
/// Amplitude of a tone divided by that of the six-step voltage: sqrt(p_k / 2) = 0.2 max(S_g).
pub const TONE_AMPLITUDE: f64 = 0.2;

/// Six-step voltage S_g at `t` s: a vector of `amplitude` V that jumps by 60° six times per period of the fundamental
/// of `hz`.
pub fn six_step(amplitude: f64, hz: f64, t: f64) -> Complex {
    // A jump that coincides with a sample counts as before it, independent of the rounding of `t`.
    let sector = (6.0 * hz * t + 1e-9).floor().rem_euclid(6.0);
    Complex::from_polar(amplitude, FRAC_PI_3 * sector)
}

/// r(t) of Eq. 43 with five tones of amplitude 1 at multiples of 1/`period` Hz and Schroeder's phases psi_k = -pi k
/// (k-1) / 5. All tones are equally strong and the peak is low: 2.83, against 5 with phases of zero.
pub fn schroeder(period: f64, t: f64) -> f64 {
    let tone = |k: u32| {
        let k = f64::from(k);
        (TAU * k * t / period - PI * k * (k - 1.0) / f64::from(TONES)).cos()
    };
    (1..=TONES).map(tone).sum()
}

/// Six-step plus Schroeder voltage S_s: the same r(t) on either axis, with a period of two periods of the fundamental.
///
/// The paper prints neither the phases nor the period nor the distribution of r(t) to the axes. This choice is
/// the closest to its tables among those that were tried.
pub fn six_step_and_schroeder(amplitude: f64, hz: f64, t: f64) -> Complex {
    let r = TONE_AMPLITUDE * amplitude * schroeder(2.0 / hz, t);
    six_step(amplitude, hz, t) + Complex::new(r, r)
}

/// A pseudo-random binary sequence from a shift register of 8 bits with linear feedback: +1 or -1 with the longest
/// period, [`Self::PERIOD`].
#[derive(Clone, Copy, Debug)]
pub struct Prbs(pub u8);

impl Default for Prbs {
    fn default() -> Self {
        Self(1)
    }
}

impl Prbs {
    /// Number of values after which the sequence repeats.
    pub const PERIOD: usize = 255;

    /// Returns the next value.
    pub fn step(&mut self) -> f64 {
        let out = self.0 & 1;
        self.0 = (self.0 >> 1) ^ (0xB8 * out);
        f64::from(out) * 2.0 - 1.0
    }
}

/// The filter omega_n³ / (s + omega_n)³ (Eq. 44) for one vector: three first-order sections by Tustin's rule.
///
/// Applying the same linear filter to voltage and current does not change the equation between them, so the rule does
/// not bias the estimate.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    gain: f64,
    /// Input, and output of each section.
    state: [Complex; 4],
}

impl Filter {
    /// Makes a filter with the corner `omega_n` rad/s at a sampling period of `h` s, at rest.
    pub fn new(omega_n: f64, h: f64) -> Self {
        Self { gain: omega_n * h / (2.0 + omega_n * h), state: [Complex::ZERO; 4] }
    }

    /// Filters one sample.
    #[inline]
    pub fn step(&mut self, x: Complex) -> Complex {
        let mut before = std::mem::replace(&mut self.state[0], x);
        let mut input = x;
        for y in &mut self.state[1..] {
            let next = *y + (input + before - *y * 2.0) * self.gain;
            before = std::mem::replace(y, next);
            input = next;
        }
        input
    }
}

/// Noise of section 5: uniform, independent on either axis, up to `largest` in either direction.
pub fn noise(rng: &mut impl Rng, largest: f64) -> Complex {
    let mut component = || largest * (2.0 * rng.random::<f64>() - 1.0);
    Complex::new(component(), component())
}
