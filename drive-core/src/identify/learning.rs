//! Learning with locked shaft: the reference of the angle tracking over the torque current, the
//! current-dependent saliency, and the gain mismatch of the two current sensors.
//!
//! With the shaft locked the flux rotates at slip frequency, and its angle is known from the currents
//! without a position sensor. The torque current steps through the points of the table, each with both
//! signs; at each point the demodulated signal is averaged over whole half turns of the flux. Components
//! that repeat with every half turn average out; they measure the sensors: with the gain of channel a high
//! by `d` and that of b low by `d`, the negative sequence of the carrier adds
//!
//! ```text
//! q_d = d 2/sqrt3 sin(2 theta - 30°) - d/sqrt3
//! ```
//!
//! Two checks detect a shaft that is not locked. A shaft turned from outside induces a quadrature voltage
//! that is equal for both signs of the torque current, while all other components change sign with it. A
//! free shaft follows the current, and the flux aligns with the current: the whole stator inductance then
//! acts on the direct axis, instead of the leakage `sigma L_s` alone. (This requires a compensated
//! inverter drop.)

#[cfg(test)]
mod tests;

use core::f32::consts::{PI, TAU};

use crate::io::{PERIOD_S, periods};
use crate::math::angle::{Angle, UnitVector};
use crate::math::frames::{Dq, SQRT_3};
use crate::settings::Motor;
use crate::settings::table::{CarrierTable, Grid, POINTS, ReferenceTable};

/// Settling time of flux and averages at a point, in rotor time constants.
const SETTLE_T: f32 = 2.0;
/// Minimum averaging time at a point, s. One second reduces sensor noise of 5 mA to 0.2°.
const AVERAGE_S: f32 = 1.0;
/// Maximum averaging time, s; longer where three half turns of the flux at the smallest torque current take longer.
const LONGEST_S: f32 = 30.0;
/// Lag of the synchronous demodulation, samples: 19 of the averages, and 4.5 on average because they are
/// evaluated once in ten samples.
const LAG: f32 = 23.5;
/// Largest quadrature voltage common to both signs of the torque current, as an electrical speed at the flux of the
/// drive, rad/s: 22 rpm of four poles. With the dissertation's motor it is 0.5 V; the noise of the mean is below 0.05 V.
const MOVED_RAD_PER_S: f32 = 4.66;
/// Expected direct voltage of a free shaft from which on the shaft is judged, likewise. Half of it counts as moved.
const JUDGED_RAD_PER_S: f32 = 9.32;
/// A twelfth of a turn, 30°.
const TWELFTH: Angle = Angle::from_bits(357_913_941);

/// Largest accepted even part of the reference. Noise gives 0.001.
const ASYMMETRY: f32 = 0.005;
/// Largest accepted gain mismatch.
const LARGEST_MISMATCH: f32 = 0.1;
/// Limit of the negative-sequence component that a gain mismatch cannot cause: absolute part, and share of
/// the component that it can cause.
const WRONG_PHASE: (f32, f32) = (0.001, 0.25);
/// Largest accepted current-dependent saliency at a current of one step of the table, and rms misfit of its law
/// relative to the rms of the reference.
const CURRENT_SALIENCY: (f32, f32) = (0.075, 0.35);

/// Coefficients of the learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learning {
    /// Settling time of a point, control periods.
    settle: u32,
    /// Minimum and maximum averaging time, control periods.
    average: (u32, u32),
    /// Torque currents of the table.
    grid: Grid,
    /// Number of table points to learn, without zero.
    points: usize,
    /// Direct current, A.
    i_d: f32,
    /// sigma L_s, H.
    leakage: f32,
    /// L_m^2 / L_r, H.
    coupled: f32,
    /// rad/s per turn per control period.
    rad_per_s: f32,
}

/// Input of the learning, one per control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningSample {
    /// Demodulated signal: the saliency, or a current difference in A.
    pub signal: f32,
    /// Squared carrier current, A^2.
    pub carrier_squared: f32,
    /// Angle of the injection axis, electrical.
    pub theta: Angle,
    /// Frequency of the injection axis, electrical turns per period.
    pub flux_freq: f32,
    /// Voltage without the carrier in the flux frame, V peak.
    pub voltage: Dq,
}

/// Sums over one point.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    elapsed: u32,
    count: u32,
    /// Electrical turns of the flux since averaging began.
    turned: f32,
    /// Completed half turns.
    halves: u32,
    signal: f32,
    /// Squares of the carrier current, A^2.
    carrier: f32,
    in_phase: f32,
    quadrature: f32,
    voltage: Dq,
}

/// State of the learning.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearningState {
    /// Index of the present point: two for every current of the table, plus and minus.
    point: usize,
    sums: Sums,
    /// Mean signal at the positive and at the negative currents.
    signal: [[f32; POINTS]; 2],
    /// Mean squared carrier current over both signs of every current, A^2.
    carrier: [f32; POINTS],
    /// Mean voltage at the positive current, V.
    voltage: Dq,
    /// At the first current: direct voltage without that of the leakage, V, and slip times torque current,
    /// rad/s A.
    first: Option<(f32, f32)>,
    /// Sums of the negative-sequence components over the points.
    in_phase: f32,
    quadrature: f32,
}

/// Action of the drive in the next control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LearningAction {
    /// Regulate this torque current, A.
    Current(f32),
    /// All points are measured.
    Done,
    /// The shaft is not locked.
    Moved,
    /// A point took too long: the flux does not rotate.
    Stuck,
}

/// A fitted value with its misfit and acceptance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fitted {
    /// The value.
    pub value: f32,
    /// Unexplained part of the measurement; defined with each value.
    pub misfit: f32,
    /// Whether value and misfit are within their bounds. Otherwise the previous value stays in use.
    pub accepted: bool,
}

/// Result of a learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Learned {
    /// Reference over the torque current: of the saliency, or of the current difference in A.
    pub reference: ReferenceTable,
    /// Carrier current over the torque current, if plausible.
    pub carrier: Option<CarrierTable>,
    /// Number of measured points, without zero; the tables are constant beyond.
    pub points: usize,
    /// Largest even part of the reference, which should be odd. Beyond 0.005 the whole result is refused.
    pub asymmetry: f32,
    /// (gain of current sensor a) / (gain of b) - 1, within ±0.1. Misfit: the negative-sequence part that
    /// no gain mismatch can cause, as a gain. Synchronous demodulation only.
    pub gain_mismatch: Fitted,
    /// Saliency per ampere of stator current, 1/A, within ±0.075 at one step of the table: least squares of the reference on
    /// 2 i_d i_q/|i|. Misfit: rms of the residual relative to that of the reference, at most 0.35.
    pub current_saliency: Fitted,
    /// Flux-fixed saliency at nominal flux measured by the check at the start (±5 % by noise); 0 without
    /// the check. For information only.
    pub flux_saliency: f32,
    /// Whether the reference, and with it the whole result, is used.
    pub accepted: bool,
}

impl Learning {
    /// Learning for a motor with the direct current `i_d`, A, and currents up to `largest_a`, A peak.
    pub fn new(motor: &Motor, i_d: f32, largest_a: f32) -> Self {
        let grid = Grid::for_current(largest_a);
        let most = libm::sqrtf(largest_a * largest_a - i_d * i_d) / grid.step_a();
        let coupled = motor.coupled_inductance();
        // At a torque current i_q the flux makes a half turn in pi i_d tau_r / i_q.
        let half_turn_s = PI * i_d * motor.tau_r() / grid.step_a();
        Self {
            settle: periods(SETTLE_T * motor.tau_r()),
            average: (periods(AVERAGE_S), periods(LONGEST_S).max(periods(3.0 * half_turn_s))),
            grid,
            points: (most as usize).min(POINTS - 1),
            i_d,
            leakage: motor.l_ls + motor.l_m - coupled,
            coupled,
            rad_per_s: TAU / PERIOD_S,
        }
    }

    /// Number of points of a learning: two for every current of the table.
    pub fn points(&self) -> usize {
        2 * self.points
    }

    /// The point that is being measured, from 1 on, and the number of points.
    pub fn progress(&self, state: &LearningState) -> (usize, usize) {
        (self.points().min(state.point + 1), self.points())
    }

    /// Torque current of a point, A.
    fn current(&self, point: usize) -> f32 {
        let i_q = self.grid.current(point / 2 + 1);
        if point.is_multiple_of(2) { i_q } else { -i_q }
    }

    /// Processes one control period.
    pub fn step(&self, state: &mut LearningState, sample: &LearningSample) -> LearningAction {
        if state.point >= self.points() {
            return LearningAction::Done;
        }
        let s = &mut state.sums;
        s.elapsed = s.elapsed.saturating_add(1);
        if s.elapsed <= self.settle {
            return LearningAction::Current(self.current(state.point));
        }
        let seen = sample.theta - Angle::within_turn(sample.flux_freq * LAG);
        let UnitVector { cos, sin } = (seen + seen - TWELFTH).unit_vector();
        s.count += 1;
        s.turned += sample.flux_freq;
        s.signal += sample.signal;
        s.carrier += sample.carrier_squared;
        s.in_phase += sample.signal * sin;
        s.quadrature += sample.signal * cos;
        s.voltage += sample.voltage;
        if s.count > self.average.1 {
            return LearningAction::Stuck;
        }
        // A point ends at a completed half turn.
        let half_turned = 2.0 * s.turned.abs() >= (s.halves + 1) as f32;
        s.halves += u32::from(half_turned);
        if half_turned && s.count >= self.average.0 && !self.finish(state) {
            return LearningAction::Moved;
        }
        if state.point >= self.points() {
            LearningAction::Done
        } else {
            LearningAction::Current(self.current(state.point))
        }
    }

    /// Evaluates the sums of a completed point. False when the shaft moved.
    fn finish(&self, state: &mut LearningState) -> bool {
        let (s, point) = (state.sums, state.point);
        state.sums = Sums::default();
        state.point += 1;
        let mean = 1.0 / s.count as f32;
        if let Some(q) = state.signal.get_mut(point % 2).and_then(|t| t.get_mut(point / 2 + 1)) {
            *q = s.signal * mean;
        }
        if let Some(carrier) = state.carrier.get_mut(point / 2 + 1) {
            *carrier += 0.5 * s.carrier * mean;
        }
        state.in_phase += 2.0 * s.in_phase * mean;
        state.quadrature += 2.0 * s.quadrature * mean;
        let voltage = s.voltage * mean;
        if point.is_multiple_of(2) {
            state.voltage = voltage;
            return true;
        }
        let even = (voltage + state.voltage) * 0.5;
        let x = self.rad_per_s * s.turned * mean * self.current(point);
        let direct = even.d + self.leakage * x;
        let (first_v, first_x) = *state.first.get_or_insert((direct, x));
        let free_shaft_v = self.coupled * (x - first_x);
        let flux = self.coupled * self.i_d;
        let judged = free_shaft_v > JUDGED_RAD_PER_S * flux;
        let follows = judged && direct - first_v < -0.5 * free_shaft_v;
        even.q.abs() <= MOVED_RAD_PER_S * flux && !follows
    }

    /// Evaluates all points.
    ///
    /// `normalised`: the signal is the saliency, not a current difference. `flux_saliency`: result of the
    /// saliency check, or 0. `baseline`: squared carrier current without torque current, A^2.
    pub fn result(
        &self,
        state: &LearningState,
        normalised: bool,
        flux_saliency: f32,
        baseline: f32,
    ) -> Learned {
        let [plus, minus] = &state.signal;
        let per_point = 1.0 / self.points().max(1) as f32;
        let to_gain = SQRT_3 * per_point; // of a over b: 2 d
        let mut gain_mismatch = Fitted {
            value: to_gain * state.in_phase,
            misfit: to_gain * state.quadrature.abs(),
            accepted: false,
        };
        gain_mismatch.accepted = normalised
            && gain_mismatch.value.abs() <= LARGEST_MISMATCH
            && gain_mismatch.misfit <= WRONG_PHASE.0 + WRONG_PHASE.1 * gain_mismatch.value.abs();
        // Contribution of the mismatch to both signs, -d/sqrt3.
        let offset = if gain_mismatch.accepted { -0.5 / SQRT_3 * gain_mismatch.value } else { 0.0 };

        let mut q = [0.0; POINTS];
        let (mut asymmetry, mut held) = (0.0_f32, 0.0);
        let (mut xx, mut xq, mut qq) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (n, (place, (p, m))) in q.iter_mut().zip(plus.iter().zip(minus)).enumerate() {
            if n <= self.points {
                held = 0.5 * (p - m);
                let even = 0.5 * (p + m) - offset;
                // NaN is detected in the reference.
                if n > 0 && even.abs() > asymmetry {
                    asymmetry = even.abs();
                }
                let i_q = self.grid.current(n);
                let x = 2.0 * self.i_d * i_q / libm::sqrtf(self.i_d * self.i_d + i_q * i_q);
                xx += x * x;
                xq += x * held;
                qq += held * held;
            }
            *place = held;
        }
        let value = xq / xx;
        let rest = qq - value * xq;
        let misfit = libm::sqrtf(if rest > 0.0 { rest / qq } else { 0.0 });
        let current_saliency = Fitted {
            value,
            misfit,
            accepted: normalised
                && value.abs() * self.grid.step_a() <= CURRENT_SALIENCY.0
                && misfit <= CURRENT_SALIENCY.1,
        };
        let mut ratio = [1.0; POINTS];
        let mut held = 1.0;
        for (n, (place, square)) in ratio.iter_mut().zip(state.carrier).enumerate().skip(1) {
            if n <= self.points {
                held = libm::sqrtf(square / baseline);
            }
            *place = held;
        }
        let reference = ReferenceTable::from_points(self.grid, q);
        Learned {
            reference: reference.unwrap_or_default(),
            carrier: CarrierTable::from_points(self.grid, ratio),
            points: self.points,
            asymmetry,
            gain_mismatch,
            current_saliency,
            flux_saliency,
            accepted: reference.is_some() && asymmetry <= ASYMMETRY && self.points > 0,
        }
    }
}

impl Learned {
    /// Whether a stored result is plausible, i.e. could come from an accepted learning. The tables check
    /// their own values.
    pub fn is_believable(&self) -> bool {
        let within = |fitted: &Fitted, largest: f32| {
            fitted.misfit.is_finite() && (!fitted.accepted || fitted.value.abs() <= largest)
        };
        self.accepted
            && self.asymmetry <= ASYMMETRY
            && (1..POINTS).contains(&self.points)
            && within(&self.gain_mismatch, LARGEST_MISMATCH)
            && within(&self.current_saliency, CURRENT_SALIENCY.0 / self.reference.grid().step_a())
            && self.flux_saliency.is_finite()
    }

    /// Combines this result with the result `before` that was in use during the learning. Values not
    /// accepted keep their previous state; the gain mismatch adds to the one already corrected.
    pub fn on_top_of(&self, before: Option<&Self>) -> Self {
        let mut learned = *self;
        if let Some(before) = before {
            let gains = before.gain_mismatch;
            if !self.gain_mismatch.accepted {
                learned.gain_mismatch = gains;
            } else if gains.accepted {
                learned.gain_mismatch.value += gains.value;
            }
            if !self.current_saliency.accepted {
                learned.current_saliency = before.current_saliency;
            }
            learned.carrier = self.carrier.or(before.carrier);
        }
        learned
    }
}
