//! Complex numbers.

use core::f64::consts::{FRAC_PI_2, PI};
use core::ops::{Add, Div, Mul, Sub};

/// A complex number, for frequency responses and poles; not for the control step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// 1
    pub const ONE: Self = Self::new(1.0, 0.0);

    /// `re + j im`
    pub const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }

    /// e^(j angle)
    pub fn unit(angle: f64) -> Self {
        let (im, re) = sin_cos(angle);
        Self { re, im }
    }

    /// Magnitude, for parts between 1e-150 and 1e150: the squares are formed.
    pub fn abs(self) -> f64 {
        libm::sqrt(self.re * self.re + self.im * self.im)
    }

    /// Phase in (-π, π].
    pub fn arg(self) -> f64 {
        libm::atan2(self.im, self.re)
    }

    /// Phase in degrees, (-180, 180].
    pub fn arg_deg(self) -> f64 {
        self.arg() * (180.0 / PI)
    }

    /// Magnitude in decibel.
    pub fn db(self) -> f64 {
        20.0 * libm::log10(self.abs())
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.im + o.im)
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.re - o.re, self.im - o.im)
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self::new(self.re * o.re - self.im * o.im, self.re * o.im + self.im * o.re)
    }
}

impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self::new(self.re * k, self.im * k)
    }
}

impl Div for Complex {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let norm = o.re * o.re + o.im * o.im;
        Self::new(
            (self.re * o.re + self.im * o.im) / norm,
            (self.im * o.re - self.re * o.im) / norm,
        )
    }
}

/// Sine and cosine, to 2e-16 for angles up to a thousand turns.
///
/// `libm`'s take 6 KiB of the microcontroller for angles that do not occur here.
pub(crate) fn sin_cos(angle: f64) -> (f64, f64) {
    // To within an eighth of a turn. The upper part of a quarter turn has 33 bits: its multiples are
    // exact.
    const UPPER: f64 = 1.570_796_326_734_125_6;
    const LOWER: f64 = 6.077_100_506_506_192e-11;
    let quarters = angle / FRAC_PI_2;
    let quarter = if quarters < 0.0 { (quarters - 0.5) as i64 } else { (quarters + 0.5) as i64 };
    let n = quarter as f64;
    let x = angle - n * UPPER - n * LOWER;

    // Taylor's series: the first term left out is below 1e-17.
    let square = x * x;
    let series = |terms: &[f64]| terms.iter().fold(0.0, |sum, term| 1.0 - sum * square * term);
    let cos = series(&COSINE);
    let sin = x * series(&SINE);
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// 1/((2k)(2k - 1)), from k = 9 down: cos x = 1 - x²/2 (1 - x²/12 (1 - …)).
const COSINE: [f64; 9] = over_products(-1.0);
/// 1/((2k)(2k + 1)): sin x = x (1 - x²/6 (1 - x²/20 (1 - …))).
const SINE: [f64; 9] = over_products(1.0);

const fn over_products(beside: f64) -> [f64; 9] {
    let mut terms = [0.0; 9];
    let mut i = 0;
    while i < terms.len() {
        let even = 2.0 * (terms.len() - i) as f64;
        terms[i] = 1.0 / (even * (even + beside));
        i += 1;
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_those_of_libm() {
        for n in -200_000_i32..=200_000 {
            let angle = f64::from(n) * 3.141_7e-2;
            let (sin, cos) = sin_cos(angle);
            // Angles beyond a few turns come with their own rounding, up to 4.5e-13 at 6283 rad.
            let allowed = 3e-16 + 1e-19 * angle.abs();
            assert!((sin - libm::sin(angle)).abs() < allowed, "sin {angle}");
            assert!((cos - libm::cos(angle)).abs() < allowed, "cos {angle}");
        }
        for angle in [0.0, -0.0, 1e-300, FRAC_PI_2, PI, -PI, 0.25 * PI] {
            let (sin, cos) = sin_cos(angle);
            assert!(
                (sin - libm::sin(angle)).abs() < 2e-16 && (cos - libm::cos(angle)).abs() < 2e-16
            );
        }
        assert!(sin_cos(f64::NAN).0.is_nan() && sin_cos(f64::INFINITY).1.is_nan());
    }
}
