//! Lock monitor: checks in every injection period that the tracked angle is the angle of the flux.
//!
//! The tracker uses only the saliency component across the injection axis (`q`,
//! [`crate::carrier::synchronous`]) and drives it to its offset. The offset is also met when the flux has
//! decayed, or rotates under the axis too fast to be followed. A false lock ends in this condition: a
//! current in the wrong direction lets the flux decay, and with it the saliency that would pull the axis
//! back.
//!
//! The other component changes the amplitude of the injection current along the axis, which the
//! demodulation also provides. With the saliency vector `s` in the estimated flux frame,
//!
//! ```text
//! |C| ~ 1 - Re s     q ~ Im s     s = a f e^(2 j e) + (current-dependent part)
//! loss = (1 - |C|^2 / |C|_ref^2) (-1/k) = 1 - f cos 2e                 k = 2a
//! ```
//!
//! (with the injection across the flux; along it `Re s` and `Im s` have the opposite signs; a of either sign, fixed to the flux; e the
//! angle error, f = 1 at nominal flux). `loss` is the saliency deficit. It
//! is 0 at the true angle, 1 without flux, 2 at an error of 90°, and averages to 1 when the flux rotates under the
//! axis. Resistances, dead time and speed hardly influence the deficit, and no perturbation is needed. The voltage
//! equation does not help at low speed: a wrong angle changes it by less than 1 V, while the dead time alone leaves 2
//! V.
//!
//! The unit is the learned sensitivity k at the q-axis current, at most 2.5 times its value without current. For a motor that
//! saturates, the sensitivity, not the saliency at rest, determines how much |C| changes. A deficit of either sign is a fault.
//! With a negative sensitivity, too much flux gives a negative deficit. With a positive sensitivity, of a motor whose main flux
//! saturates, zero flux gives a deficit of about -0.45: the chord inductance across the flux returns to the unsaturated one,
//! which outweighs the missing saliency. Therefore the limits depend on the sign of the sensitivity.
//!
//! While the q-axis current changes, the tables belong to another current, and the deficit is not judged. The monitor
//! pauses for 12 injection periods after a change, but at most 40 % of the time, so that a command that always changes
//! does not blind it.
//!
//! An error of 180° gives no deficit by symmetry, but the current does not maintain it: the flux decays
//! through zero to the true sign, or the deficit is detected during the decay.
//!
//! An asymmetry of sensors or stator that arises during a run changes `|C|` with the direction of the axis in the stator. Therefore the
//! [asymmetry](crate::carrier::Asymmetry::follow) follows the part of `|C|` that is [beyond its mean](LockMonitor::beyond).
//!
//! `|C|_ref` is the injection current measured during magnetisation, when the direction of the flux is
//! known, times a learned even function of i_q.

use crate::Fault;
use crate::carrier::Saliency;
use crate::table::{CarrierTable, Grid, POINTS, SlopeTable, between};

/// Coefficients of the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LockMonitor {
    /// Q-axis currents of the table of the injection current.
    pub grid: Grid,
    /// 1 / ratio^2 of the table of the injection current.
    pub inverse_square: [f32; POINTS],
    /// Saliency deficit per relative change of the squared injection current: -1/k, with the other sign if the injection lies along
    /// the flux.
    pub per_change: [f32; POINTS],
    /// Share of the newest value in the mean deficit.
    pub smoothing: f32,
    /// Allowed mean deficit, where 1 corresponds to zero flux, and whether the sensitivity is positive, which determines the limit of a
    /// negative deficit.
    pub allowed: f32,
    pub is_positive: bool,
    /// Change of the q-axis current in an injection period above which the monitor pauses, A.
    pub moved: f32,
    /// Square of the minimum injection current, A^2.
    pub least: f32,
}

/// State of the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LockMonitorState {
    /// Mean squared injection current at i_q = 0, A^2.
    pub baseline: f32,
    /// 1 / `baseline`; 0 until it is first needed.
    per_baseline: f32,
    /// Mean saliency deficit.
    pub loss: f32,
    /// Latest saliency deficit; the mean one after it was used.
    latest: f32,
    /// Q-axis current of the last injection period, A.
    i_q: f32,
    /// Injection periods for which the q-axis current has been constant.
    rested: u8,
    /// Allowance for pauses; see [`REST`].
    allowance: u8,
    /// Consecutive injection periods with too little injection current.
    weak: u8,
    /// Injection periods in the baseline since the start.
    measured: u8,
}

impl LockMonitorState {
    /// Whether the baseline has been measured since the start.
    pub fn is_measured(&self) -> bool {
        self.measured >= MEASURED
    }
}

/// Injection periods in the mean baseline, 0.05 s: noise of 5 mA causes an error of 0.14 % in the baseline and of 0.04 in the
/// deficit.
const AVERAGED: u8 = 30;
/// Injection periods for a baseline: 0.1 s.
const MEASURED: u8 = 60;
/// Consecutive injection periods with too little current until the fault. The averages of the demodulation need four to fill.
const WEAK_PERIODS: u8 = 8;

/// Allowed negative deficit, with a negative and with a positive sensitivity.
const ALLOWED_GAIN: [f32; 2] = [0.6, 0.3];
/// Largest unit relative to the unit without q-axis current.
const MOST_UNIT: f32 = 2.5;
/// Injection periods of a pause after a change of the current.
const REST: u8 = 12;
/// Allowance for pauses: each injection period of a pause costs 3, each other period adds 2 up to the largest value.
/// Pauses therefore take 40 % of the time at most, and 24 injection periods at once.
const ALLOWANCE: (u8, u8, u8) = (3, 2, 72);

impl LockMonitor {
    /// Takes the injection current over i_q and the saliency sensitivity; `sign` as in [`Estimator`](crate::flux::Estimator).
    #[cold] // in the flash
    pub fn take(&mut self, carrier: &CarrierTable, slope: &SlopeTable, sign: f32) {
        self.grid = carrier.grid();
        self.inverse_square = carrier.points().map(|r| 1.0 / (r * r));
        self.per_change = slope.inverses(MOST_UNIT).map(|inverse| -sign * inverse);
        self.is_positive = slope.at_rest() > 0.0;
    }

    /// Evaluates one injection period.
    ///
    /// `per_share_squared` is 1 / (share of the injection amplitude in use)^2. While the axis is `held` by a source other
    /// than the injection (magnetisation, or the observer), the flux lies along it, and the baseline is measured.
    ///
    /// # Errors
    /// [`Fault::CarrierWeak`] after eight consecutive injection periods with too little injection current at
    /// any angle; [`Fault::LostLock`] when the mean deficit exceeds the allowed one.
    pub fn step(
        &self,
        state: &mut LockMonitorState,
        saliency: &Saliency,
        per_share_squared: f32,
        held: bool,
    ) -> Result<(), Fault> {
        let carrier = saliency.carrier_squared * per_share_squared;
        state.weak = if carrier >= self.least { 0 } else { state.weak.saturating_add(1) };
        Fault::CarrierWeak.unless(state.weak < WEAK_PERIODS)?;
        if held {
            let place = self.grid.place(saliency.i_q);
            let carrier = carrier * between(&self.inverse_square, place);
            let measured = state.measured.saturating_add(1);
            let change = (carrier - state.baseline) / f32::from(measured.min(AVERAGED));
            *state = LockMonitorState {
                baseline: state.baseline + change,
                measured,
                weak: state.weak,
                i_q: saliency.i_q,
                rested: REST,
                allowance: ALLOWANCE.2,
                ..LockMonitorState::default()
            };
            return Ok(());
        }
        if state.per_baseline == 0.0 {
            state.per_baseline = 1.0 / state.baseline;
        }
        if self.rests(state, saliency.i_q) {
            return Ok(());
        }
        let place = self.grid.place(saliency.i_q);
        let deviation = carrier * state.per_baseline * between(&self.inverse_square, place) - 1.0;
        let loss = -deviation * between(&self.per_change, place);
        state.latest = loss;
        state.loss += self.smoothing * (loss - state.loss);
        let least = -ALLOWED_GAIN[usize::from(self.is_positive)];
        Fault::LostLock.unless(state.loss <= self.allowed && state.loss >= least)
    }

    /// Returns by how much the squared injection current, relative to the expected one, is beyond its mean; 0 if nothing was judged since
    /// the last call.
    pub fn beyond(&self, state: &mut LockMonitorState) -> f32 {
        let beyond = state.loss - core::mem::replace(&mut state.latest, state.loss);
        beyond / between(&self.per_change, self.grid.place(state.i_q))
    }

    /// Whether the q-axis current `i_q`, A, has just changed, so that the deficit is not judged.
    fn rests(&self, state: &mut LockMonitorState, i_q: f32) -> bool {
        let moved = (i_q - state.i_q).abs() > self.moved;
        state.i_q = i_q;
        state.rested = if moved { 0 } else { state.rested.saturating_add(1) };
        let (takes, gives, most) = ALLOWANCE;
        let rests = state.rested < REST && state.allowance >= takes;
        state.allowance =
            if rests { state.allowance - takes } else { (state.allowance + gives).min(most) };
        rests
    }
}

#[cfg(test)]
mod tests;
