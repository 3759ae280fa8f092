//! Complex numbers.

use core::f64::consts::PI;
use core::ops::{Add, Div, Mul, Sub};

use crate::math::elementary::{atan2, sin_cos, sqrt};

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
        sqrt(self.re * self.re + self.im * self.im)
    }

    /// Phase in (-π, π].
    pub fn arg(self) -> f64 {
        atan2(self.im, self.re)
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
