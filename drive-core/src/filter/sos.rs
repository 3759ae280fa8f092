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

use crate::AlphaBeta;

use crate::filter::section::{Section, group_delay, response};
use crate::math::complex::Complex;

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

    /// The same with `b0` = 1 in all sections but the last, which has the gain of all: where the
    /// coefficients are constants a multiplication by 1 is none.
    pub const fn with_gain_last(rows: &[[f64; 5]; N]) -> Self {
        let mut rows = *rows;
        let mut n = 0;
        while n + 1 < N {
            let b0 = rows[n][0];
            let mut k = 0;
            while k < 3 {
                rows[n][k] /= b0;
                rows[N - 1][k] *= b0;
                k += 1;
            }
            n += 1;
        }
        Self::from_f64(&rows)
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
