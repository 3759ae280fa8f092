//! Complex numbers in `f32`: plain multiplications and additions, nothing fused.

use core::ops::{Add, AddAssign, Mul, Neg, Sub};

use crate::AlphaBeta;

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex32 {
    /// Real part.
    pub re: f32,
    /// Imaginary part.
    pub im: f32,
}

impl Complex32 {
    /// 0
    pub const ZERO: Self = Self::new(0.0, 0.0);

    /// `re + j im`
    pub const fn new(re: f32, im: f32) -> Self {
        Self { re, im }
    }

    /// `re - j im`
    pub const fn conj(self) -> Self {
        Self::new(self.re, -self.im)
    }

    /// Square of the magnitude.
    pub const fn square(self) -> f32 {
        self.re * self.re + self.im * self.im
    }

    /// Whether both parts are finite.
    pub const fn is_finite(self) -> bool {
        self.re.is_finite() && self.im.is_finite()
    }
}

impl From<AlphaBeta> for Complex32 {
    fn from(x: AlphaBeta) -> Self {
        Self::new(x.alpha, x.beta)
    }
}

impl From<Complex32> for AlphaBeta {
    fn from(x: Complex32) -> Self {
        Self::new(x.re, x.im)
    }
}

impl Add for Complex32 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.im + o.im)
    }
}

impl AddAssign for Complex32 {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Sub for Complex32 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.re - o.re, self.im - o.im)
    }
}

impl Neg for Complex32 {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

impl Mul for Complex32 {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self::new(self.re * o.re - self.im * o.im, self.re * o.im + self.im * o.re)
    }
}

impl Mul<f32> for Complex32 {
    type Output = Self;
    fn mul(self, k: f32) -> Self {
        Self::new(self.re * k, self.im * k)
    }
}
