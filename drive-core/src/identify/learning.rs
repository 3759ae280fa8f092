//! Learning with locked shaft: reference and slope of the angle tracking over the torque current, the
//! current-dependent saliency, and the asymmetry of sensors and stator.
//!
//! With the shaft locked the flux rotates at slip frequency, and its angle is known from the currents
//! without a position sensor. At each point a torque current is regulated in a frame that lies behind the flux by the lead
//! e of the flux, and the demodulated signal q is averaged over whole half turns of the flux:
//!
//! ```text
//! reference(i_q) = q(i_q, 0)        slope k(i_q) = dq/de = (q(i_q, x) - q(i_q, -x)) / 2x
//! i_d' = i_d cos e + i_q sin e      i_q' = i_q cos e - i_d sin e
//! ```
//!
//! The flux sees i_d' and i_q', which give its magnetising current and its slip. It does not slip where tan x = i_q/i_d, so
//! tan x is an odd multiple of half a step of the table over i_d: 8.5° to 15°. Each point has a mirrored one, (-i_q, -e);
//! q is odd. Components that repeat with every half turn average out; they are the
//! [asymmetry](crate::carrier::asymmetry) of sensors and stator, with the part of q that is even. A part that repeats four times
//! in a turn comes from a current sensor that is not linear, and cannot be taken out: where it is large, learning refuses.
//!
//! Two checks detect a shaft that is not locked. A shaft turned from outside induces a quadrature voltage
//! that is equal at both points of a pair, while all other components change sign. A
//! free shaft follows the current, and the flux aligns with the current: the whole stator inductance then
//! acts on the direct axis, instead of the leakage `sigma L_s` alone. (This requires a compensated
//! inverter drop.)

mod evaluate;
#[cfg(test)]
mod tests;

use core::f32::consts::{PI, TAU};

use crate::io::{PERIOD_S, periods};
use crate::math::angle::{Angle, UnitVector};
use crate::math::frames::Dq;
use crate::settings::Motor;
use crate::settings::table::{Grid, POINTS};

pub use crate::learned::{Fitted, LEAST_SLOPE, Learned, Verdict};
pub use evaluate::Start;

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
/// Least tangent of the lead of the flux: 8.5°.
const LEAST_TAN_LEAD: f32 = 0.15;
/// Largest tangent that half a step may give, 15°, and the tangent where it gives more: a small direct current, with which
/// the flux slips at every lead below half a step.
const MOST_TAN_LEAD: f32 = 0.27;
const LONE_TAN_LEAD: f32 = 0.2;

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
    /// Whether the signal is the saliency, so that its slope is learned, too. Otherwise it is a current difference.
    pub(crate) normalised: bool,
    /// Lead x of the flux, rad.
    lead: f32,
    /// Direct current, A.
    i_d: f32,
    /// Rotor time constant, s.
    tau_r: f32,
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
    /// Voltage without the carrier in the drive's frame, V peak.
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
    /// Parts in phase with the sine and the cosine of twice the angle of the injection axis.
    sin: f32,
    cos: f32,
    /// The same of four times that angle.
    twice: [f32; 2],
    voltage: Dq,
}

/// State of the learning.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearningState {
    /// Number of the present point.
    point: usize,
    sums: Sums,
    /// Mean signal and voltage, V, of the first point of the present pair.
    first_of_pair: (f32, Dq),
    /// Odd part of the signal over the torque current: without lead, with the lead x, and with -x.
    odd: [[f32; POINTS]; LEADS.len()],
    /// Even part of the signal over all pairs: sum, least, largest.
    even: (f32, f32, f32),
    /// Sums over all points of the parts in phase with the sine and the cosine.
    sin: f32,
    cos: f32,
    /// Largest square of the part that repeats four times in a turn, of all points.
    ripple: f32,
    /// Mean squared carrier current over both signs of every current without lead, A^2.
    carrier: [f32; POINTS],
    /// At the first current: direct voltage without that of the leakage, V, and slip times torque current,
    /// rad/s A.
    first: Option<(f32, f32)>,
}

/// Leads of the flux at the pairs of a torque current, in units of x.
const LEADS: [f32; 3] = [0.0, 1.0, -1.0];

/// A point of the learning.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    /// Index of its current in the table.
    n: usize,
    /// Index of its lead in [`LEADS`].
    lead: usize,
    /// Whether it is the second of its pair, with torque current and lead of the opposite sign.
    mirrored: bool,
}

/// Operating point that the drive is to regulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operate {
    /// Torque current, A.
    pub i_q: f32,
    /// Lead of the flux before the drive's frame, rad.
    pub lead: f32,
}

/// Action of the drive in the next control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LearningAction {
    /// Regulate this.
    Operate(Operate),
    /// All points are measured.
    Done,
    /// The shaft is not locked.
    Moved,
    /// A point took too long: the flux does not rotate.
    Stuck,
}

impl Learning {
    /// Learning for a motor with the direct current `i_d`, A, and currents up to `largest_a`, A peak. `normalised`: the
    /// signal is the saliency, not a current difference.
    pub fn new(motor: &Motor, i_d: f32, largest_a: f32, normalised: bool) -> Self {
        let grid = Grid::for_current(largest_a);
        let most = libm::sqrtf(largest_a * largest_a - i_d * i_d) / grid.step_a();
        let coupled = motor.coupled_inductance();
        let half_step = 0.5 * grid.step_a() / i_d;
        // The flux makes a half turn in pi tau_r i_d / i_q.
        let least_slip = if half_step > MOST_TAN_LEAD { LONE_TAN_LEAD } else { half_step };
        let half_turn_s = PI * motor.tau_r() / least_slip;
        let tan_lead = if half_step > MOST_TAN_LEAD {
            LONE_TAN_LEAD
        } else {
            let odd = 2.0 * libm::ceilf(0.5 * (LEAST_TAN_LEAD / half_step - 1.0)) + 1.0;
            half_step * if odd > 1.0 { odd } else { 1.0 }
        };
        Self {
            settle: periods(SETTLE_T * motor.tau_r()),
            average: (periods(AVERAGE_S), periods(LONGEST_S).max(periods(3.0 * half_turn_s))),
            grid,
            points: (most as usize).min(POINTS - 1),
            normalised,
            lead: libm::atanf(tan_lead),
            i_d,
            tau_r: motor.tau_r(),
            leakage: motor.l_ls + motor.l_m - coupled,
            coupled,
            rad_per_s: TAU / PERIOD_S,
        }
    }

    /// Number of points of a learning: two for every current and lead of the flux, and two leads without current.
    pub fn points(&self) -> usize {
        if self.normalised { 6 * self.points + 2 } else { 2 * self.points }
    }

    /// The point that is being measured, from 1 on, and the number of points.
    pub fn progress(&self, state: &LearningState) -> (usize, usize) {
        (self.points().min(state.point + 1), self.points())
    }

    /// Expected time, s, from the beginning of a point, from 1 on, to the end of the learning. The flux rotates at slip
    /// frequency, and a point ends at a completed half turn: points of small torque current take seconds.
    pub fn seconds_left(&self, point: usize) -> f32 {
        let least_s = self.average.0 as f32 * PERIOD_S;
        let settle_s = self.settle as f32 * PERIOD_S;
        let seconds = |number| {
            let Point { n, lead, .. } = self.point(number);
            let lead = LEADS.get(lead).map_or(0.0, |lead| lead * self.lead);
            let UnitVector { cos, sin } = Angle::from_radians(lead).unit_vector();
            let i_q = self.grid.current(n);
            let (d, q) = (self.i_d * cos + i_q * sin, i_q * cos - self.i_d * sin);
            let half_turn_s = PI * self.tau_r * (d / q).abs();
            settle_s + half_turn_s * libm::ceilf(least_s / half_turn_s)
        };
        (point.max(1) - 1..self.points()).map(seconds).sum()
    }

    /// The point with this number. Pairs without lead come first, in the order of the currents.
    fn point(&self, number: usize) -> Point {
        let (pair, mirrored) = (number / 2, !number.is_multiple_of(2));
        match pair.checked_sub(self.points) {
            None => Point { n: pair + 1, lead: 0, mirrored },
            Some(0) => Point { n: 0, lead: 1, mirrored },
            Some(led) => Point { n: led.div_ceil(2), lead: 2 - led % 2, mirrored },
        }
    }

    fn operate(&self, point: Point) -> LearningAction {
        let sign = if point.mirrored { -1.0 } else { 1.0 };
        let lead = LEADS.get(point.lead).map_or(0.0, |lead| lead * self.lead);
        LearningAction::Operate(Operate {
            i_q: sign * self.grid.current(point.n),
            lead: sign * lead,
        })
    }

    /// Processes one control period.
    pub fn step(&self, state: &mut LearningState, sample: &LearningSample) -> LearningAction {
        if state.point >= self.points() {
            return LearningAction::Done;
        }
        let s = &mut state.sums;
        s.elapsed = s.elapsed.saturating_add(1);
        if s.elapsed <= self.settle {
            return self.operate(self.point(state.point));
        }
        let seen = sample.theta - Angle::within_turn(sample.flux_freq * LAG);
        let twice = (seen + seen).unit_vector();
        let UnitVector { cos, sin } = twice;
        let four = twice.turned_by(twice);
        s.count += 1;
        s.turned += sample.flux_freq;
        s.signal += sample.signal;
        s.carrier += sample.carrier_squared;
        s.sin += sample.signal * sin;
        s.cos += sample.signal * cos;
        s.twice[0] += sample.signal * four.sin;
        s.twice[1] += sample.signal * four.cos;
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
            self.operate(self.point(state.point))
        }
    }

    /// Evaluates the sums of a completed point. False when the shaft moved.
    fn finish(&self, state: &mut LearningState) -> bool {
        let (s, point) = (state.sums, self.point(state.point));
        state.sums = Sums::default();
        state.point += 1;
        let mean = 1.0 / s.count as f32;
        let (signal, voltage) = (s.signal * mean, s.voltage * mean);
        state.sin += 2.0 * s.sin * mean;
        state.cos += 2.0 * s.cos * mean;
        let [sin, cos] = s.twice.map(|sum| 2.0 * sum * mean);
        let ripple = sin * sin + cos * cos;
        if ripple > state.ripple {
            state.ripple = ripple;
        }
        if let (0, Some(carrier)) = (point.lead, state.carrier.get_mut(point.n)) {
            *carrier += 0.5 * s.carrier * mean;
        }
        if !point.mirrored {
            state.first_of_pair = (signal, voltage);
            return true;
        }
        let (first_signal, first_voltage) = state.first_of_pair;
        if let Some(q) = state.odd.get_mut(point.lead).and_then(|odd| odd.get_mut(point.n)) {
            *q = 0.5 * (first_signal - signal);
        }
        let even = 0.5 * (first_signal + signal);
        let (sum, least, largest) = state.even;
        state.even = match state.point {
            2 => (even, even, even),
            // NaN stays in the sum.
            _ => (sum + even, least.min(even), largest.max(even)),
        };
        let even = (voltage + first_voltage) * 0.5;
        let follows = point.lead == 0 && self.follows(state, point, even.d, s.turned * mean);
        let flux = self.coupled * self.i_d;
        even.q.abs() <= MOVED_RAD_PER_S * flux && !follows
    }

    /// Whether a free shaft follows the current, by the mean direct voltage, V, of a pair without lead and the slip, turns
    /// per period.
    fn follows(&self, state: &mut LearningState, point: Point, voltage: f32, slip: f32) -> bool {
        let x = self.rad_per_s * slip.abs() * self.grid.current(point.n);
        let direct = voltage + self.leakage * x;
        let (first_v, first_x) = *state.first.get_or_insert((direct, x));
        let free_shaft_v = self.coupled * (x - first_x);
        let judged = free_shaft_v > JUDGED_RAD_PER_S * self.coupled * self.i_d;
        judged && direct - first_v < -0.5 * free_shaft_v
    }
}
