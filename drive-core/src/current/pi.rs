//! PI controllers with the anti-windup of Appendix B, and the reference filter of Eq. 3.40.
//!
//! The controller is Eq. B.3 in immediate form,
//!
//! ```text
//! u[k] = u_realised[k-1] + k_c (e[k] - z_c e[k-1])        C(z) = k_c (z - z_c)/(z - 1)
//! ```
//!
//! where `u_realised` is the output that reached the plant: limited, compensated, corrected. The source
//! prints `u[k+1]` on the left (B.1, B.3). Taken literally this is one more delay: the printed example is
//! then unstable without any limit (|z| = 1.0996), and Figure 40 is not reproduced.
//!
//! A step consists of two calls: `step` returns the wanted output, `back_calculate` takes the difference between realised and wanted
//! output. Without the second call (or with zero) the controller is exactly the unlimited one. The loops of current and speed use a part
//! of the difference only, [`Pi::condition`]: with the whole difference the voltage leaves its limit before the current has reached its
//! reference, and a torque step takes twice as long.
//!
//! The state is the output itself, in `f32`: near 180 V it does not change for errors below
//! 7.6 µV / (k_c (1 - z_c)), which is 2.5 µA with the gains of section 3.10.

#[cfg(test)]
mod tests;

use crate::Dq;

/// Coefficients of a PI controller, Eq. 3.35.
///
/// ```
/// use induction_drive_core::current::{Pi, PiState};
///
/// let (pi, mut state) = (Pi { k_c: 2.0, z_c: 0.5 }, PiState::default());
/// assert_eq!(pi.step(&mut state, 1.0), 2.0);
/// assert_eq!(pi.step(&mut state, 1.0), 3.0); // integrates k_c (1 - z_c) e
/// state.back_calculate(2.5 - 3.0); // the actuator was limited to 2.5
/// assert_eq!(pi.step(&mut state, 1.0), 3.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pi {
    /// Gain k_c, output unit per input unit (V/A in the current loop).
    pub k_c: f32,
    /// Zero z_c, in [0, 1).
    pub z_c: f32,
}

/// State of a PI controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PiState {
    /// Realised output of the last step.
    pub output: f32,
    error: f32,
}

impl Pi {
    /// Returns the wanted output for `error` = reference - measured.
    pub fn step(&self, state: &mut PiState, error: f32) -> f32 {
        let output = state.output + self.k_c * (error - self.z_c * state.error);
        *state = PiState { output, error };
        output
    }

    /// Filters one sample of the reference, any unit: Eq. 3.40 with its pole `p_f` at `z_c`, beside a `direct` share s of the
    /// reference, 0 to 1,
    ///
    /// ```text
    /// F(z) = s + (1 - s) (1 - p_f)/(z - p_f)
    /// ```
    ///
    /// The gain is 1 at dc. As printed, with s = 0, the filter is strictly proper: the output depends on the references up to
    /// the previous step, and the pole cancels the zero of the controller in the response to the reference.
    pub fn filter(&self, state: &mut ReferenceState, direct: f32, reference: f32) -> f32 {
        let rest = reference - state.next;
        let output = state.next + direct * rest;
        state.next += (1.0 - self.z_c) * rest;
        output
    }

    /// Conditions the controller by `correction` = realised - wanted output, if the output was limited. The controller continues as if
    /// the last error had been smaller by `correction/k_c`, which is the error of a reference that could be realised (Hanus, Kinnaert
    /// and Henrotte, Automatica 23(6), 1987). The next step takes `z_c` of that error back, so `1 - z_c` of the correction remains.
    pub fn condition(&self, state: &mut PiState, correction: f32) {
        state.back_calculate((1.0 - self.z_c) * correction);
    }

    /// Changes the last step as if its error had been larger by `more`. Returns the increase of the wanted output.
    pub fn revise(&self, state: &mut PiState, more: f32) -> f32 {
        state.error += more;
        state.output += self.k_c * more;
        self.k_c * more
    }
}

impl PiState {
    /// Returns a controller that has settled at this output.
    pub fn at_rest(output: f32) -> Self {
        Self { output, error: 0.0 }
    }

    /// Anti-windup: adds `correction` = realised - wanted output, zero if nothing was limited.
    pub fn back_calculate(&mut self, correction: f32) {
        self.output += correction;
    }
}

/// Coefficients of the current loop in the flux frame: one controller per axis, A peak to V peak.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DqPi {
    /// The d axis.
    pub d: Pi,
    /// The q axis.
    pub q: Pi,
}

/// State of the current loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DqPiState {
    /// The d axis.
    pub d: PiState,
    /// The q axis.
    pub q: PiState,
}

impl DqPi {
    /// Wanted voltage, V peak, for `error` = reference - measured current, A peak.
    pub fn step(&self, state: &mut DqPiState, error: Dq) -> Dq {
        Dq { d: self.d.step(&mut state.d, error.d), q: self.q.step(&mut state.q, error.q) }
    }

    /// [Conditions](Pi::condition) the controllers by `correction` = realised - wanted voltage, V peak.
    pub fn condition(&self, state: &mut DqPiState, correction: Dq) {
        self.d.condition(&mut state.d, correction.d);
        self.q.condition(&mut state.q, correction.q);
    }

    /// Cancels the integration of the last error. Called before each step, it makes the controllers proportional.
    pub fn freeze_integrator(&self, state: &mut DqPiState) {
        let integral = |pi: &Pi, state: &PiState| pi.k_c * (1.0 - pi.z_c) * state.error;
        let last = Dq { d: integral(&self.d, &state.d), q: integral(&self.q, &state.q) };
        state.back_calculate(-last);
    }
}

impl DqPiState {
    /// Adds `correction` to the voltages.
    pub fn back_calculate(&mut self, correction: Dq) {
        self.d.back_calculate(correction.d);
        self.q.back_calculate(correction.q);
    }
}

/// Direct share of the current reference, beside the printed filter. The filter alone takes 7.3 ms to 90 % of a torque step;
/// without it the zero of the controller causes 25 % of overshoot. A share of 0.8 cancels the slow mode of the loop; 0.6
/// leaves a margin for the low-pass filter and for the injection current, which adds to an overshoot.
pub const DIRECT_SHARE: f32 = 0.6;
/// Direct share without injection, and therefore without the low-pass filter in the loop.
pub const DIRECT_SHARE_WITHOUT_CARRIER: f32 = 0.8;

/// State of [`Pi::filter`]: its next output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceState {
    next: f32,
}

impl ReferenceState {
    /// Returns a filter that has settled at this reference.
    pub const fn at_rest(reference: f32) -> Self {
        Self { next: reference }
    }
}
