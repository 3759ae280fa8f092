//! Lock monitor: checks in every carrier period that the tracked angle is that of the flux.
//!
//! The tracker uses only the saliency component across the injection axis (`q`,
//! [`crate::carrier::synchronous`]) and drives it to its reference. The reference is also met when the flux
//! has decayed, or turns under the axis too fast to be followed. A false lock ends in this condition:
//! current in the wrong direction lets the flux decay, and with it the saliency that would pull the axis
//! back.
//!
//! The other component changes the amplitude of the carrier current along the axis, which the demodulation
//! provides as well. With the saliency vector `s` in the estimated flux frame,
//!
//! ```text
//! |C| ~ 1 - Re s     q ~ Im s     s = a f e^(2 j e) + (current-dependent part)
//! loss = (1 - |C|^2 / |C|_ref^2) (-1/k) = 1 - f cos 2e                 k = 2a
//! ```
//!
//! (a of either sign, fixed to the flux; e the angle error, f = 1 at nominal flux). The loss is 0 at the true angle, 1
//! without flux, 2 at an error of 90°, and averages to 1 when the flux turns under the axis. Resistances,
//! dead time and speed hardly influence it, and no perturbation is needed. The voltage equation does not
//! help at low speed: a wrong angle changes it by less than 1 V, while the dead time alone leaves 2 V.
//!
//! The unit is the learned slope k at the torque current, at most 2.5 times that without current: on a motor of iron it is
//! the slope, not the saliency seen at rest, that says how much |C| changes. Both signs of the loss are wrong. Too much flux
//! gives a negative loss with a negative slope. With a positive slope, of a motor whose main flux saturates, a flux that is gone
//! reads some -0.45: the chord inductance across the flux falls back to the unsaturated one, and that outweighs the lost
//! saliency. So the limits depend on the sign of the slope.
//!
//! While the torque current moves, the tables are those of another current, and the loss is not judged: for 12 carrier
//! periods after a move, but at most 40 % of the time, so that a command that never rests does not blind the monitor.
//!
//! An error of 180° gives no loss by symmetry, but the current does not maintain it: the flux decays through
//! zero to the true sign, or the loss is detected on the way.
//!
//! `|C|_ref` is the carrier current measured during magnetisation, when the direction of the flux is known,
//! times a learned even function of i_q.

use crate::Fault;
use crate::carrier::Saliency;
use crate::carrier::injection::CARRIER_S;
use crate::learned::Learned;
use crate::table::{CarrierTable, Grid, POINTS, SlopeTable, between};

/// Coefficients of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockMonitor {
    /// Torque currents of the carrier table.
    grid: Grid,
    /// 1 / ratio^2 of the carrier table.
    inverse_square: [f32; POINTS],
    /// Loss per relative change of the squared carrier current, -1/k.
    per_change: [f32; POINTS],
    /// Share of the newest value in the mean loss.
    smoothing: f32,
    /// Allowed loss, and whether the slope is positive, which gives the other limit.
    allowed: f32,
    is_positive: bool,
    /// Change of the torque current in a carrier period that counts as a move, A.
    moved: f32,
    /// Square of the minimum carrier current, A^2.
    least: f32,
}

/// Settings of the monitor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LockMonitorSettings {
    /// Slope of the saliency, on the grid of the carrier table.
    pub slope: SlopeTable,
    /// Time constant of the mean loss, s.
    pub smoothing_s: f32,
    /// Allowed mean loss; 1 corresponds to zero flux.
    pub allowed: f32,
    /// Expected carrier current along the injection axis, A peak.
    pub carrier_a: f32,
    /// Change of the torque current in a carrier period that counts as a move, A.
    pub moved_a: f32,
}

/// State of the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LockMonitorState {
    /// Mean squared carrier current at i_q = 0, A^2.
    pub baseline: f32,
    /// 1 / `baseline`; 0 until it is first needed.
    per_baseline: f32,
    /// Mean loss.
    pub loss: f32,
    /// Torque current of the last carrier period, A.
    i_q: f32,
    /// Carrier periods for which it has rested.
    rested: u8,
    /// Rest that it may still take; see [`REST`].
    allowance: u8,
    /// Consecutive carrier periods with too little carrier current.
    weak: u8,
    /// Carrier periods in the baseline since the start.
    measured: u8,
}

impl LockMonitorState {
    /// Whether the baseline has been measured since the start.
    pub fn is_measured(&self) -> bool {
        self.measured >= MEASURED
    }
}

/// Carrier periods in the mean baseline, 0.05 s: noise of 5 mA causes 0.14 % of error in it, 0.04 in the loss.
const AVERAGED: u8 = 30;
/// Carrier periods that make a baseline: 0.1 s.
const MEASURED: u8 = 60;
/// Minimum carrier current as a share of the expected one. With an open phase the carrier current is
/// reduced by the squared cosine of the angle between the injection axis and the remaining current axis.
const LEAST_CARRIER: f32 = 0.5;
/// Consecutive weak carrier periods until the fault. The averages of the demodulation need four to fill.
const WEAK_PERIODS: u8 = 8;

/// Allowed negative loss, with a negative and with a positive slope.
const ALLOWED_GAIN: [f32; 2] = [0.6, 0.3];
/// Largest unit relative to that without torque current.
const MOST_UNIT: f32 = 2.5;
/// Carrier periods of rest after a move.
const REST: u8 = 12;
/// Allowance for rest: each resting carrier period takes 3, each other one gives 2 up to the largest. So it is 40 % of the
/// time at most, and 24 carrier periods at once.
const ALLOWANCE: (u8, u8, u8) = (3, 2, 72);

fn per_change(slope: &SlopeTable) -> [f32; POINTS] {
    slope.inverses(MOST_UNIT).map(|inverse| -inverse)
}

fn inverse_square(table: &CarrierTable) -> [f32; POINTS] {
    table.points().map(|r| 1.0 / (r * r))
}

impl LockMonitor {
    /// Monitor with the carrier current over i_q of `table`.
    pub fn new(table: &CarrierTable, s: &LockMonitorSettings) -> Self {
        let least = LEAST_CARRIER * s.carrier_a;
        Self {
            grid: table.grid(),
            inverse_square: inverse_square(table),
            per_change: per_change(&s.slope),
            is_positive: s.slope.at_rest() > 0.0,
            moved: s.moved_a,
            smoothing: CARRIER_S / (s.smoothing_s + CARRIER_S),
            allowed: s.allowed,
            least: least * least,
        }
    }

    /// Takes an accepted result of a learning.
    pub fn take(&mut self, learned: &Learned) {
        if let (Some(carrier), Some(slope)) = (&learned.carrier, &learned.slope) {
            (self.grid, self.inverse_square) = (carrier.grid(), inverse_square(carrier));
            (self.per_change, self.is_positive) = (per_change(slope), slope.at_rest() > 0.0);
        }
    }

    /// Evaluates one carrier period.
    ///
    /// `per_share_squared` is 1 / (share of the carrier amplitude in use)^2. While the axis is `held` by something else than
    /// the injection (magnetisation, or the observer), the flux lies along it, and the baseline is measured.
    ///
    /// # Errors
    /// [`Fault::CarrierWeak`] after eight consecutive carrier periods with too little carrier current at any
    /// angle; [`Fault::LostLock`] when the mean loss exceeds the allowed one.
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
        state.loss += self.smoothing * (loss - state.loss);
        let least = -ALLOWED_GAIN[usize::from(self.is_positive)];
        Fault::LostLock.unless(state.loss <= self.allowed && state.loss >= least)
    }

    /// Whether the torque current `i_q`, A, has just moved, so that the loss is not judged.
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
