//! Digital filters as second-order sections.
//!
//! A filter is a constant set of coefficients ([`Sos`]) and any number of states ([`SosState`] for
//! one signal, [`AlphaBetaState`] for both components of a vector). The step is transposed direct
//! form II in `f32`: it never panics, and anything non-finite that enters stays in the state until
//! [`SosState::reset`].
//!
//! There is no direct form (Eq. C.1) of higher order here, on purpose. With the coefficients of
//! Tables 7 and 8 rounded to `f32` it is wrong by 13 mA (LPF) and up to 15 mA rms (PP) for currents
//! of 3 A, more than the 10 mA the demodulation looks for; sections are wrong by 2 µA and 11 µA.

use core::f64::consts::PI;
use core::ops::{Add, Div, Mul, Sub};

use crate::AlphaBeta;

/// One section,
///
/// ```text
///          b0 + b1 z⁻¹ + b2 z⁻²
/// H(z) =  ----------------------
///           1 + a1 z⁻¹ + a2 z⁻²
/// ```
///
/// so `a1` and `a2` have the sign of Eq. C.2 and are subtracted in the step, as in Eq. C.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Coefficient of the input.
    pub b0: f32,
    /// Coefficient of the input one sample ago.
    pub b1: f32,
    /// Coefficient of the input two samples ago.
    pub b2: f32,
    /// Coefficient of the output one sample ago.
    pub a1: f32,
    /// Coefficient of the output two samples ago.
    pub a2: f32,
}

impl Section {
    /// The section that changes nothing.
    pub const IDENTITY: Self = Self { b0: 1.0, b1: 0.0, b2: 0.0, a1: 0.0, a2: 0.0 };

    /// From `[b0, b1, b2, a1, a2]`, each rounded to the nearest `f32`.
    pub const fn from_f64(c: [f64; 5]) -> Self {
        Self { b0: c[0] as f32, b1: c[1] as f32, b2: c[2] as f32, a1: c[3] as f32, a2: c[4] as f32 }
    }

    /// Whether both poles lie inside the unit circle (Jury: |a2| < 1 and |a1| < 1 + a2).
    pub const fn is_stable(&self) -> bool {
        let (a1, a2) = (self.a1 as f64, self.a2 as f64);
        a2 < 1.0 && a1 < 1.0 + a2 && -a1 < 1.0 + a2
    }

    /// H(1) of the rounded coefficients.
    pub const fn dc_gain(&self) -> f64 {
        (self.b0 as f64 + self.b1 as f64 + self.b2 as f64) / (1.0 + self.a1 as f64 + self.a2 as f64)
    }

    /// The section with its gain multiplied by `gain`.
    pub const fn scaled(self, gain: f64) -> Self {
        Self {
            b0: (self.b0 as f64 * gain) as f32,
            b1: (self.b1 as f64 * gain) as f32,
            b2: (self.b2 as f64 * gain) as f32,
            ..self
        }
    }

    fn numerator(&self) -> [f64; 3] {
        [self.b0.into(), self.b1.into(), self.b2.into()]
    }

    fn denominator(&self) -> [f64; 3] {
        [1.0, self.a1.into(), self.a2.into()]
    }
}

/// A cascade of `N` sections: coefficients only.
///
/// The loop over the sections unrolls completely. A vector through four sections is 127 instructions
/// on a Cortex-M4F, 115 where the coefficients are constants at the place of the call: then a section
/// with `b0 == b2` (a zero pair on the unit circle) takes one multiplication less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sos<const N: usize> {
    /// The sections, in the order they are run.
    pub sections: [Section; N],
}

impl<const N: usize> Sos<N> {
    /// From rows `[b0, b1, b2, a1, a2]`, each coefficient rounded to the nearest `f32`.
    pub const fn from_f64(rows: &[[f64; 5]; N]) -> Self {
        let mut sections = [Section::IDENTITY; N];
        let mut n = 0;
        while n < N {
            sections[n] = Section::from_f64(rows[n]);
            n += 1;
        }
        Self { sections }
    }

    /// The same filter with H(1) = 1. The gain goes into the last section, so nothing before it
    /// changes its range; one more rounding of three coefficients.
    pub const fn with_unit_dc_gain(mut self) -> Self {
        if N > 0 {
            self.sections[N - 1] = self.sections[N - 1].scaled(1.0 / self.dc_gain());
        }
        self
    }

    /// H(1) of the rounded coefficients.
    pub const fn dc_gain(&self) -> f64 {
        let mut gain = 1.0;
        let mut n = 0;
        while n < N {
            gain *= self.sections[n].dc_gain();
            n += 1;
        }
        gain
    }

    /// Whether all poles lie inside the unit circle.
    pub const fn is_stable(&self) -> bool {
        let mut n = 0;
        while n < N {
            if !self.sections[n].is_stable() {
                return false;
            }
            n += 1;
        }
        true
    }

    /// One sample, any unit.
    #[inline]
    pub fn step(&self, state: &mut SosState<N>, x: f32) -> f32 {
        let mut y = x;
        for (c, s) in self.sections.iter().zip(state.sections.iter_mut()) {
            let x = y;
            y = c.b0 * x + s[0];
            s[0] = c.b1 * x - c.a1 * y + s[1];
            s[1] = c.b2 * x - c.a2 * y;
        }
        y
    }

    /// One sample of both components of a vector: exactly [`Sos::step`] on each, in one loop.
    #[inline]
    pub fn step_alpha_beta(&self, state: &mut AlphaBetaState<N>, x: AlphaBeta) -> AlphaBeta {
        let mut y = x;
        for (c, s) in self.sections.iter().zip(state.sections.iter_mut()) {
            let x = y;
            y.alpha = c.b0 * x.alpha + s[0].alpha;
            y.beta = c.b0 * x.beta + s[0].beta;
            s[0].alpha = c.b1 * x.alpha - c.a1 * y.alpha + s[1].alpha;
            s[0].beta = c.b1 * x.beta - c.a1 * y.beta + s[1].beta;
            s[1].alpha = c.b2 * x.alpha - c.a2 * y.alpha;
            s[1].beta = c.b2 * x.beta - c.a2 * y.beta;
        }
        y
    }

    /// [`response`] of this filter.
    pub fn response(&self, omega_t: f64) -> Complex {
        response(&self.sections, omega_t)
    }

    /// [`group_delay`] of this filter.
    pub fn group_delay(&self, omega_t: f64) -> f64 {
        group_delay(&self.sections, omega_t)
    }
}

/// What an [`Sos`] remembers of one signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SosState<const N: usize> {
    sections: [[f32; 2]; N],
}

impl<const N: usize> SosState<N> {
    /// At rest.
    pub const ZERO: Self = Self { sections: [[0.0; 2]; N] };

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::ZERO;
    }

    /// Whether every state is finite; once one is not, only [`SosState::reset`] helps.
    pub fn is_finite(&self) -> bool {
        self.sections.iter().all(|s| s[0].is_finite() && s[1].is_finite())
    }
}

impl<const N: usize> Default for SosState<N> {
    fn default() -> Self {
        Self::ZERO
    }
}

/// What an [`Sos`] remembers of both components of a vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaBetaState<const N: usize> {
    sections: [[AlphaBeta; 2]; N],
}

impl<const N: usize> AlphaBetaState<N> {
    /// At rest.
    pub const ZERO: Self = Self { sections: [[AlphaBeta::ZERO; 2]; N] };

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::ZERO;
    }

    /// Whether every state is finite; once one is not, only [`AlphaBetaState::reset`] helps.
    pub fn is_finite(&self) -> bool {
        self.sections.iter().all(|s| s[0].is_finite() && s[1].is_finite())
    }
}

impl<const N: usize> Default for AlphaBetaState<N> {
    fn default() -> Self {
        Self::ZERO
    }
}

/// H(e^(j ωT)) of a cascade, with the coefficients as they are stored; `omega_t` in rad/sample.
///
/// Not for the control step.
pub fn response(sections: &[Section], omega_t: f64) -> Complex {
    let delay = Complex::unit(-omega_t);
    sections.iter().fold(Complex::ONE, |h, s| {
        h * polynomial(s.numerator(), delay) / polynomial(s.denominator(), delay)
    })
}

/// Group delay -d arg H / d(ωT) of a cascade in samples, analytically; `omega_t` in rad/sample.
///
/// A zero exactly at this frequency makes it not-a-number. Not for the control step.
pub fn group_delay(sections: &[Section], omega_t: f64) -> f64 {
    let delay = Complex::unit(-omega_t);
    let of = |[c0, c1, c2]: [f64; 3]| {
        let derivative = polynomial([0.0, c1, 2.0 * c2], delay);
        (derivative / polynomial([c0, c1, c2], delay)).re
    };
    sections.iter().map(|s| of(s.numerator()) - of(s.denominator())).sum()
}

fn polynomial([c0, c1, c2]: [f64; 3], x: Complex) -> Complex {
    Complex::new(c0, 0.0) + x * (Complex::new(c1, 0.0) + x * Complex::new(c2, 0.0))
}

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
        Self { re: libm::cos(angle), im: libm::sin(angle) }
    }

    /// Magnitude.
    pub fn abs(self) -> f64 {
        libm::hypot(self.re, self.im)
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
