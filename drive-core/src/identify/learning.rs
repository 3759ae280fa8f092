//! Saliency self-commissioning with a locked shaft. It learns the saliency offset and the saliency
//! sensitivity over the q-axis current, the current-dependent saliency, and the asymmetry of sensors
//! and stator.
//!
//! With the shaft locked the flux rotates at slip frequency, and its angle is known from the currents without a position
//! sensor. At each point a q-axis current is regulated in a frame that the flux leads by the angle e, and the demodulated
//! signal q is averaged:
//!
//! ```text
//! q_ref(i_q) = q(i_q, 0)            k(i_q) = dq/de = (q(i_q, x) - q(i_q, -x)) / 2x
//! i_d' = i_d cos e + i_q sin e      i_q' = i_q cos e - i_d sin e
//! ```
//!
//! In the flux frame the current is i_d' and i_q', which give the magnetising current and the slip. The flux does not slip if tan
//! x = i_q/i_d. Therefore tan x is an odd multiple of half a step of the table over i_d, the first one above 5.7°, up to 17°. Each point
//! has a mirrored one, (-i_q, -e), since q is odd. In the mirrored point the flux turns back over the angles of the first, so that parts
//! that depend on the angle alone cancel.
//!
//! At currents at which the flux makes a half turn in about the averaging time or less, points last for whole half turns. The three
//! smallest of these currents come first. (At larger currents a gain mismatch also causes a real current that rotates backwards.)
//! Components of q that repeat there with every half turn, and the even part of q, are the [asymmetry](crate::carrier::asymmetry) of
//! sensors and stator. They are subtracted from the samples of all other points, which need no whole turn. A part that repeats four times
//! in a turn is due to a current sensor that is not linear, and cannot be subtracted. If it is large, the result is refused.
//!
//! The offset is learned at every current of the table, the sensitivity at every other current, with interpolation between.
//! The magnetising current i_d' of a pair equals that of its neighbour within a few percent, or exactly, so the flux hardly
//! has to settle.
//!
//! Two checks detect a shaft that is not locked. A shaft that is turned from outside induces a q-axis
//! voltage that is equal at both points of a pair, while all other components change sign. A free shaft
//! follows the current, and the flux aligns with the current. Then the whole stator inductance acts on
//! the d axis, instead of the leakage `sigma L_s` alone. (This requires that the inverter voltage error
//! is compensated.)

mod evaluate;
mod points;
#[cfg(test)]
mod tests;

use core::f32::consts::TAU;

use crate::carrier::Asymmetry;
use crate::table::{Grid, POINTS};
use crate::{Angle, Dq, Fault, PERIOD_S, periods};

pub use crate::learned::{Fitted, Learned, Verdict};
pub use evaluate::Start;
use points::Point;

/// Lag of the synchronous demodulation, samples: 19 for the averages, and 4.5 on average because they
/// are evaluated once in ten samples.
const LAG: f32 = 23.5;
/// Largest q-axis voltage common to both signs of the q-axis current, as an electrical speed at the flux of the drive,
/// rad/s: 22 rpm of four poles. With the dissertation's motor it is 0.5 V; the noise of the mean is below 0.05 V.
const MOVED_RAD_PER_S: f32 = 4.66;
/// Expected d-axis voltage of a free shaft above which the shaft is judged, as an electrical speed, rad/s. Half of that voltage
/// means that the shaft has moved.
const JUDGED_RAD_PER_S: f32 = 9.32;
/// Conversion from turns per control period to rad/s.
const RAD_PER_S: f32 = TAU / PERIOD_S;

/// Coefficients of the self-commissioning.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Learning {
    /// Longest time of a point, control periods.
    pub longest: u32,
    /// Table point of the first pair.
    pub first: usize,
    /// Q-axis currents of the table.
    pub grid: Grid,
    /// Number of table points to learn, without zero.
    pub points: usize,
    /// Whether the signal is the saliency, so that its sensitivity is also learned. Otherwise it is a current difference.
    pub normalised: bool,
    /// Sign of the saliency along the injection axis, as in [`Estimator`](crate::flux::Estimator).
    pub sign: f32,
    /// Lead x of the flux, rad.
    pub lead: f32,
    /// Settling times of the flux, in rotor time constants: from one current with a lead to the next, and at the largest
    /// current, where the lead changes its sign.
    pub flux_t: [f32; 2],
    /// D-axis current, A.
    pub i_d: f32,
    /// Rotor time constant, s.
    pub tau_r: f32,
    /// sigma L_s, H.
    pub leakage: f32,
    /// L_m^2 / L_r, H.
    pub coupled: f32,
}

/// Input of the self-commissioning, one per control period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningSample {
    /// Demodulated signal: the saliency, or a current difference in A.
    pub signal: f32,
    /// Squared injection current, A^2.
    pub carrier_squared: f32,
    /// Angle of the injection axis, electrical.
    pub theta: Angle,
    /// Frequency of the injection axis, electrical turns per period.
    pub flux_freq: f32,
    /// Voltage without the injection in the drive's frame, V peak.
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
    /// Squares of the injection current, A^2.
    carrier: f32,
    /// Parts in phase with cosine (d) and sine (q) of twice the angle of the injection axis.
    twice: Dq,
    /// Parts in phase with cosine (d) and sine (q) of four times that angle.
    four_times: Dq,
    voltage: Dq,
}

/// State of the self-commissioning.
#[derive(Clone, Copy, Debug, Default)]
pub struct LearningState {
    /// Number of the present point.
    point: usize,
    sums: Sums,
    /// Mean signal and voltage, V, of the first point of the present pair.
    first_of_pair: (f32, Dq),
    /// Odd part of the signal over the q-axis current: without lead, with the lead x, and with the lead -x.
    odd: [[f32; POINTS]; LEADS.len()],
    /// Even part of the signal over all pairs: sum, least, largest.
    even: (f32, f32, f32),
    /// Means over the first pairs of the parts in phase with the sine and the cosine of twice the angle.
    turning: Asymmetry,
    /// Largest square of the part that repeats four times in a turn, of the points of whole half turns.
    ripple: f32,
    /// Mean squared injection current over both signs of every current without lead, A^2.
    carrier: [f32; POINTS],
    /// Values at the first current: d-axis voltage without the voltage of the leakage, V, and slip times
    /// q-axis current, rad/s A.
    first: Option<(f32, f32)>,
}

/// Leads of the flux at the pairs of a q-axis current, in units of x.
const LEADS: [f32; 3] = [0.0, 1.0, -1.0];

/// Operating point that the drive is to regulate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operate {
    /// Q-axis current, A.
    pub i_q: f32,
    /// Angle by which the flux leads the drive's frame, rad.
    pub lead: f32,
}

impl Learning {
    /// Number of pairs from which the asymmetry is computed.
    pub const TURNING: usize = 3;

    fn operate(&self, point: Point) -> Operate {
        let sign = if point.mirrored { -1.0 } else { 1.0 };
        let lead = LEADS.get(point.lead).map_or(0.0, |lead| lead * self.lead);
        Operate { i_q: sign * self.grid.current(point.n), lead: sign * lead }
    }

    /// Processes one control period. Returns the operating point of the next period, or `None` when all points are measured.
    ///
    /// # Errors
    /// [`Fault::ShaftNotLocked`] if the shaft moved, or if a point took too long because the flux does not rotate.
    pub fn step(
        &self,
        state: &mut LearningState,
        sample: &LearningSample,
    ) -> Result<Option<Operate>, Fault> {
        if state.point >= self.points() {
            return Ok(None);
        }
        let point = self.point(state.point);
        let s = &mut state.sums;
        s.elapsed = s.elapsed.saturating_add(1);
        if s.elapsed <= periods(point.settle_s) {
            return Ok(Some(self.operate(point)));
        }
        let seen = sample.theta - Angle::within_turn(sample.flux_freq * LAG);
        let twice = (seen + seen).unit_vector();
        s.count += 1;
        s.turned += sample.flux_freq;
        s.voltage += sample.voltage;
        if point.turns {
            s.signal += sample.signal;
            s.carrier += sample.carrier_squared;
            s.twice += twice * sample.signal;
            s.four_times += twice.turned_by(twice) * sample.signal;
        } else {
            let known = &state.turning;
            s.signal += sample.signal - known.sin * twice.sin - known.cos * twice.cos;
            let along = if self.normalised { known.along(twice) } else { 0.0 };
            s.carrier += sample.carrier_squared * (1.0 - 2.0 * along);
        }
        Fault::ShaftNotLocked.unless(s.count <= self.longest)?;
        let half_turned = 2.0 * s.turned.abs() >= (s.halves + 1) as f32;
        s.halves += u32::from(half_turned);
        if s.count >= periods(point.average_s) && (half_turned || !point.turns) {
            self.finish(state, point)?;
        }
        let is_left = state.point < self.points();
        Ok(is_left.then(|| self.operate(self.point(state.point))))
    }

    /// Evaluates the sums of a completed point.
    ///
    /// # Errors
    /// [`Fault::ShaftNotLocked`] when the shaft moved.
    #[cold]
    fn finish(&self, state: &mut LearningState, point: Point) -> Result<(), Fault> {
        let s = state.sums;
        state.sums = Sums::default();
        state.point += 1;
        let mean = 1.0 / s.count as f32;
        let (signal, voltage) = (s.signal * mean, s.voltage * mean);
        if point.turns {
            if state.point <= 2 * Self::TURNING {
                let share = mean / self.points.clamp(1, Self::TURNING) as f32;
                state.turning.sin += share * s.twice.q;
                state.turning.cos += share * s.twice.d;
            }
            let ripple = (s.four_times * (2.0 * mean)).length_squared();
            if ripple > state.ripple {
                state.ripple = ripple;
            }
        }
        if let (0, Some(carrier)) = (point.lead, state.carrier.get_mut(point.n)) {
            *carrier += 0.5 * s.carrier * mean;
        }
        if !point.mirrored {
            state.first_of_pair = (signal, voltage);
            return Ok(());
        }
        let (first_signal, first_voltage) = state.first_of_pair;
        if let Some(q) = state.odd.get_mut(point.lead).and_then(|odd| odd.get_mut(point.n)) {
            *q = 0.5 * self.sign * (first_signal - signal);
        }
        let even = 0.5 * (first_signal + signal);
        let (sum, least, largest) = state.even;
        state.even = match state.point {
            2 => (even, even, even),
            // A NaN stays in the sum.
            _ => (sum + even, least.min(even), largest.max(even)),
        };
        let even = (voltage + first_voltage) * 0.5;
        let follows = point.lead == 0 && self.follows(state, point, even.d, s.turned * mean);
        let flux = self.coupled * self.i_d;
        Fault::ShaftNotLocked.unless(even.q.abs() <= MOVED_RAD_PER_S * flux && !follows)
    }

    /// Whether a free shaft follows the current, from the mean d-axis voltage of a pair without lead, V, and the slip,
    /// turns per period.
    fn follows(&self, state: &mut LearningState, point: Point, voltage: f32, slip: f32) -> bool {
        let x = RAD_PER_S * slip.abs() * self.grid.current(point.n);
        let direct = voltage + self.leakage * x;
        let (first_v, first_x) = *state.first.get_or_insert((direct, x));
        let free_shaft_v = self.coupled * (x - first_x);
        let judged = free_shaft_v.abs() > JUDGED_RAD_PER_S * self.coupled * self.i_d;
        judged && (first_v - direct) * free_shaft_v > 0.5 * free_shaft_v * free_shaft_v
    }
}
