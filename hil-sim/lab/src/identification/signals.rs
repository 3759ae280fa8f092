//! Voltages that excite a machine, measurement noise, and the filters in front of the estimation
//! (sections 4 and 5).

use std::f64::consts::{FRAC_PI_3, PI, TAU};

use rand::{Rng, RngExt};

use super::Complex;

/// Tones of the Schroeder signal.
const TONES: u32 = 5;
/// Amplitude of a tone over that of the six-step voltage: sqrt(p_k / 2) = 0.2 max(S_g).
const TONE_AMPLITUDE: f64 = 0.2;

/// Six-step voltage S_g: a vector of `amplitude` V that jumps by 60° six times per period of the
/// fundamental of `hz`. At `t` s.
pub fn six_step(amplitude: f64, hz: f64, t: f64) -> Complex {
    // A jump that falls on a sample falls before it, whatever the rounding of `t`.
    let sector = (6.0 * hz * t + 1e-9).floor().rem_euclid(6.0);
    Complex::from_polar(amplitude, FRAC_PI_3 * sector)
}

/// r(t) of Eq. 43 with five tones of amplitude 1 at multiples of 1/`period` Hz and Schroeder's
/// phases psi_k = -pi k (k-1) / 5: all equally strong and the peak low. Peak 2.83, against 5 with
/// phases zero.
pub fn schroeder(period: f64, t: f64) -> f64 {
    let tone = |k: u32| {
        let k = f64::from(k);
        (TAU * k * t / period - PI * k * (k - 1.0) / f64::from(TONES)).cos()
    };
    (1..=TONES).map(tone).sum()
}

/// Six-step plus Schroeder voltage S_s: the same r(t) on either axis, its period two periods of the
/// fundamental.
///
/// The paper prints neither the phases nor the period nor how r(t) is laid on the axes; this choice
/// comes nearest to its tables of those that were tried.
pub fn six_step_and_schroeder(amplitude: f64, hz: f64, t: f64) -> Complex {
    let r = TONE_AMPLITUDE * amplitude * schroeder(2.0 / hz, t);
    six_step(amplitude, hz, t) + Complex::new(r, r)
}

/// Feedback taps of registers of 2 to 32 bits with the longest possible period.
#[rustfmt::skip] // a table
const TAPS: [u32; 31] = [
    0x3, 0x6, 0xC, 0x14, 0x30, 0x60, 0xB8, 0x110,
    0x240, 0x500, 0xE08, 0x1C80, 0x3802, 0x6000, 0xD008, 0x12000,
    0x20400, 0x72000, 0x9_0000, 0x14_0000, 0x30_0000, 0x42_0000, 0xE1_0000, 0x120_0000,
    0x200_0023, 0x400_0013, 0x900_0000, 0x1400_0000, 0x2000_0029, 0x4800_0000, 0x8020_0003,
];

/// A pseudo-random binary sequence of a shift register with linear feedback: +1 or -1 with a period
/// of 2^bits - 1.
#[derive(Clone, Copy, Debug)]
pub struct Prbs {
    register: u32,
    taps: u32,
}

impl Prbs {
    /// A register of this many bits, 2 to 32.
    pub fn new(bits: u32) -> Option<Self> {
        let taps = *TAPS.get(usize::try_from(bits.checked_sub(2)?).ok()?)?;
        Some(Self { register: 1, taps })
    }

    /// The next value.
    pub fn step(&mut self) -> f64 {
        let out = self.register & 1;
        self.register >>= 1;
        if out == 1 {
            self.register ^= self.taps;
        }
        f64::from(out) * 2.0 - 1.0
    }
}

/// omega_n³ / (s + omega_n)³ (Eq. 44) for one vector: three first-order sections by Tustin's rule.
///
/// Any one linear filter on voltage and current leaves the equation between them as it is, so the
/// rule does not bias the estimate.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    gain: f64,
    /// Input, and output of each section.
    state: [Complex; 4],
}

impl Filter {
    /// Corner `omega_n` rad/s at a sampling period of `h` s; at rest.
    pub fn new(omega_n: f64, h: f64) -> Self {
        Self { gain: omega_n * h / (2.0 + omega_n * h), state: [Complex::ZERO; 4] }
    }

    /// One sample.
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

/// Noise of section 5: uniform, independent on either axis, up to `largest` each way.
pub fn noise(rng: &mut impl Rng, largest: f64) -> Complex {
    let mut component = || largest * (2.0 * rng.random::<f64>() - 1.0);
    Complex::new(component(), component())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_has_the_longest_period() {
        assert!(Prbs::new(1).is_none() && Prbs::new(33).is_none() && Prbs::new(0).is_none());
        for bits in 2..=20 {
            let mut prbs = Prbs::new(bits).unwrap();
            let (start, mut period, mut sum) = (prbs.register, 0u32, 0.0);
            loop {
                sum += prbs.step();
                period += 1;
                if prbs.register == start {
                    break;
                }
            }
            assert_eq!(period, (1 << bits) - 1, "{bits} bits");
            assert_eq!(sum, 1.0, "one more +1 than -1");
        }
    }

    #[test]
    fn six_steps_per_period_and_a_jump_on_the_sample() {
        for k in 0..2000u32 {
            let v = six_step(2.0, 60.0, f64::from(k) * 50e-6);
            // 60 Hz at 50 us: a jump every 55.5 samples, exactly on every 500th sample.
            let sector = (k * 9 / 500) % 6;
            assert!((v - Complex::from_polar(2.0, FRAC_PI_3 * f64::from(sector))).norm() < 1e-12);
        }
    }

    #[test]
    fn schroeder_peaks_lower_than_cosines_and_is_flat() {
        let values: Vec<f64> = (0..1000).map(|n| schroeder(1.0, f64::from(n) / 1000.0)).collect();
        let peak = values.iter().fold(0.0f64, |peak, r| peak.max(r.abs()));
        assert!((peak - 2.83).abs() < 0.01, "{peak}");
        let power = values.iter().map(|r| r * r).sum::<f64>() / 1000.0;
        assert!((power - 2.5).abs() < 1e-9);
    }

    #[test]
    fn the_filter_has_its_corner() {
        // At omega_n a third-order section of this kind has |1/(1+j)|³ = 2^(-3/2); Tustin warps
        // omega_n h = 0.1 by h² omega_n² / 12.
        let (omega, h) = (1000.0, 1e-4);
        let mut filter = Filter::new(omega, h);
        let mut gain = 0.0;
        for n in 0..10_000 {
            gain = filter.step(Complex::from_polar(1.0, omega * h * f64::from(n))).norm();
        }
        assert!((gain - 0.5f64.powf(1.5)).abs() < 1e-3, "{gain}");
    }
}
