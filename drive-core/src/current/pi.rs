//! PI controllers with the anti-windup of Appendix B, and the reference filter of Eq. 3.40.
//!
//! The controller is Eq. B.3 in immediate form,
//!
//! ```text
//! u[k] = u_realised[k-1] + k_c (e[k] - z_c e[k-1])        C(z) = k_c (z - z_c)/(z - 1)
//! ```
//!
//! where `u_realised` is what really reached the plant: limited, compensated, corrected. The
//! source prints `u[k+1]` on the left (B.1, B.3); taken literally that is one more delay, the
//! printed example is then unstable without any limit (|z| = 1.0996) and Figure 40 does not come out.
//!
//! A step is two calls: `step` gives the output that is wanted, `realised` takes the difference
//! between what was applied and what was wanted. Not calling `realised` (or calling it with zero)
//! is the unlimited controller, exactly.
//!
//! The output is the integrator, in `f32`: near 180 V it stops moving for errors below
//! 7.6 µV / (k_c (1 - z_c)), which is 2.5 µA with the gains of section 3.10.

use crate::Dq;

/// Coefficients of a PI controller, Eq. 3.35.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pi {
    /// Gain k_c, output unit per input unit (V/A in the current loop).
    pub k_c: f32,
    /// Zero z_c, in [0, 1).
    pub z_c: f32,
}

/// State of a PI controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PiState {
    output: f32,
    error: f32,
}

impl Pi {
    /// The output wanted for this error.
    #[inline]
    pub fn step(&self, state: &mut PiState, error: f32) -> f32 {
        let output = state.output + self.k_c * (error - self.z_c * state.error);
        *state = PiState { output, error };
        output
    }
}

impl PiState {
    /// At rest.
    pub const ZERO: Self = Self { output: 0.0, error: 0.0 };

    /// Tells what was realised: `correction` = applied - wanted, zero if nothing was limited.
    #[inline]
    pub fn back_calculate(&mut self, correction: f32) {
        self.output += correction;
    }

    /// Continues from `output` as if `error` had stood for ever, so that the next step with the
    /// same error moves the output by its integral part k_c (1 - z_c) e only.
    pub fn preset(&mut self, output: f32, error: f32) {
        *self = Self { output, error };
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::ZERO;
    }

    /// The output of the last step as realised.
    pub fn output(&self) -> f32 {
        self.output
    }

    /// Whether the state is finite; once it is not, only [`PiState::reset`] or
    /// [`PiState::preset`] helps.
    pub fn is_finite(&self) -> bool {
        self.output.is_finite() && self.error.is_finite()
    }
}

/// Coefficients of the current loop: one controller per axis, currents in A, voltages in V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DqPi {
    /// Direct axis.
    pub d: Pi,
    /// Quadrature axis.
    pub q: Pi,
}

/// State of the current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DqPiState {
    output: Dq,
    error: Dq,
}

impl DqPi {
    /// The voltage wanted for this current error: exactly [`Pi::step`] on each axis.
    #[inline]
    pub fn step(&self, state: &mut DqPiState, error: Dq) -> Dq {
        let output = Dq {
            d: state.output.d + self.d.k_c * (error.d - self.d.z_c * state.error.d),
            q: state.output.q + self.q.k_c * (error.q - self.q.z_c * state.error.q),
        };
        *state = DqPiState { output, error };
        output
    }
}

impl DqPiState {
    /// At rest.
    pub const ZERO: Self = Self { output: Dq::ZERO, error: Dq::ZERO };

    /// Tells what was realised: `correction` = applied - wanted voltage, zero if nothing was
    /// limited.
    #[inline]
    pub fn back_calculate(&mut self, correction: Dq) {
        self.output += correction;
    }

    /// See [`PiState::preset`].
    pub fn preset(&mut self, output: Dq, error: Dq) {
        *self = Self { output, error };
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::ZERO;
    }

    /// The voltage of the last step as realised.
    pub fn output(&self) -> Dq {
        self.output
    }

    /// Whether the state is finite; see [`PiState::is_finite`].
    pub fn is_finite(&self) -> bool {
        self.output.is_finite() && self.error.is_finite()
    }
}

/// First-order reference filter, Eq. 3.40: F_ref(z) = (1 - p_f)/(z - p_f). Unit gain at dc.
///
/// Strictly proper as printed: the output of a step depends on references up to the step before.
/// With `p_f` = `z_c` it cancels the controller's zero in the response to the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceFilter {
    /// 1 - p_f, in (0, 1].
    pub one_minus_p: f32,
}

/// What a [`ReferenceFilter`] remembers: its next output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceState {
    next: f32,
}

impl ReferenceFilter {
    /// With its pole at `p_f`.
    pub const fn new(p_f: f64) -> Self {
        Self { one_minus_p: (1.0 - p_f) as f32 }
    }

    /// One sample.
    #[inline]
    pub fn step(&self, state: &mut ReferenceState, reference: f32) -> f32 {
        let output = state.next;
        state.next += self.one_minus_p * (reference - output);
        output
    }
}

impl ReferenceState {
    /// At rest.
    pub const ZERO: Self = Self { next: 0.0 };

    /// Continues from `output`.
    pub fn preset(&mut self, output: f32) {
        self.next = output;
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = Self::ZERO;
    }
}
