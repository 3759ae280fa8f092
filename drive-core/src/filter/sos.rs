//! Cascades of second-order sections.
//!
//! A filter is a constant set of coefficients ([`Sos`]) and any number of states ([`SosState`]), each for a
//! scalar or a vector. The step is transposed direct form II in `f32`. It never panics; a non-finite input
//! stays in the state until the state is replaced.
//!
//! A direct form of higher order (Eq. C.1) is not offered. With the coefficients of Tables 7 and 8
//! rounded to `f32` its error is 13 mA (LPF) and up to 15 mA rms (PP) for currents of 3 A, more than the
//! 10 mA that the demodulation evaluates; the error of the sections is 2 µA and 11 µA.
//!
//! Own code instead of `idsp::iir::Biquad` with `DirectForm2Transposed` (idsp 0.23.1): that processes one
//! scalar type for coefficients and samples, so a vector needs two filters and two passes. It has no
//! `const` scaling of a cascade and no group delay. Measured for LPF on a vector, x86-64: 62 instructions a sample
//! here, 175 there; rounding 1.3 µA here, 1.5 µA rms there.

use core::ops::{Add, Mul, Sub};

use crate::filter::section::{Section, response};
use num_complex::Complex64;

/// Coefficients of a cascade of `N` sections.
///
/// The loop over the sections unrolls completely. A vector through four sections takes 127 instructions
/// on a Cortex-M4F, 115 where the coefficients are constants at the call site: a section with `b0 == b2`
/// (a zero pair on the unit circle) then needs one multiplication less.
///
/// ```
/// use induction_drive_core::{AlphaBeta, filter::{Sos, SosState}};
///
/// // y[k] = 0.5 x[k] + 0.5 y[k-1] on a vector.
/// let low_pass = Sos::<1>::from_f64(&[[0.5, 0.0, 0.0, -0.5, 0.0]]);
/// assert_eq!(low_pass.dc_gain(), 1.0);
/// let mut state = SosState::default();
/// assert_eq!(low_pass.step(&mut state, AlphaBeta::new(1.0, -2.0)), AlphaBeta::new(0.5, -1.0));
/// assert_eq!(low_pass.step(&mut state, AlphaBeta::ZERO), AlphaBeta::new(0.25, -0.5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sos<const N: usize> {
    /// The sections in the order of processing.
    pub sections: [Section; N],
}

impl<const N: usize> Sos<N> {
    /// Cascade from rows `[b0, b1, b2, a1, a2]`, each coefficient rounded to the nearest `f32`.
    pub const fn from_f64(rows: &[[f64; 5]; N]) -> Self {
        let mut sections = [Section::IDENTITY; N];
        let mut n = 0;
        while n < N {
            sections[n] = Section::from_f64(rows[n]);
            n += 1;
        }
        Self { sections }
    }

    /// The filter scaled to H(1) = 1. The last section is scaled, so the signal range before it does not
    /// change; its three numerator coefficients are rounded once more.
    pub const fn with_unit_dc_gain(mut self) -> Self {
        if N > 0 {
            self.sections[N - 1] = self.sections[N - 1].scaled(1.0 / self.dc_gain());
        }
        self
    }

    /// Gain at dc, H(1), of the rounded coefficients.
    pub const fn dc_gain(&self) -> f64 {
        let mut gain = 1.0;
        let mut n = 0;
        while n < N {
            gain *= self.sections[n].dc_gain();
            n += 1;
        }
        gain
    }

    /// Filters one sample, any unit; a vector component by component.
    pub fn step<V: Signal>(&self, state: &mut SosState<V, N>, x: V) -> V {
        let mut y = x;
        for (c, s) in self.sections.iter().zip(state.sections.iter_mut()) {
            let x = y;
            y = x * c.b0 + s[0];
            s[0] = x * c.b1 - y * c.a1 + s[1];
            s[1] = x * c.b2 - y * c.a2;
        }
        y
    }

    /// [`response`] of this filter.
    pub fn response(&self, omega_t: f64) -> Complex64 {
        response(&self.sections, omega_t)
    }
}

/// A signal type of a filter: a scalar or a vector.
pub trait Signal:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self>
{
}

impl<V> Signal for V where
    V: Copy + Default + Add<Output = V> + Sub<Output = V> + Mul<f32, Output = V>
{
}

/// The state of an [`Sos`] for one signal; at rest by default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SosState<V, const N: usize> {
    sections: [[V; 2]; N],
}

impl<V: Signal, const N: usize> Default for SosState<V, N> {
    fn default() -> Self {
        Self { sections: [[V::default(); 2]; N] }
    }
}
