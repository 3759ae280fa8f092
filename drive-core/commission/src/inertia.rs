//! Step 8: the inertia, from the speed that a torque gives to a free shaft, and whether the shaft rings.
//!
//! The drive regulates torque: i_q = +i, -i, -i, +i, a quarter of a train each. The speed rises, returns, falls, and returns.
//! Let x be the integral of i_q and f the integral of the sign of the speed w; then
//!
//! ```text
//! w = K_t/J x - T_f/J f + c        K_t = 3/2 P (L_m^2/L_r) i_d
//! ```
//!
//! The inertia J and the friction T_f follow from the slopes, by least squares. The estimated speed lags after a change of
//! the current, so the first 0.03 s of every quarter do not count. With friction up to 3 % of the rated torque the inertia of
//! eleven simulated motors is found within 17 %, on plain iron within 7 %.
//!
//! Then an impulse of torque gives the shaft 5 % of its rated speed. A rigid shaft keeps it, but for the friction. Two inertias on
//! an elastic coupling oscillate against each other: see [`Ringing`](super::motion::Ringing).

use super::motion::Slope;
use super::{Answer, Collector, Commissioning, Meaning, Next, Quantity, Record};
use drive_core::{State, TestReport, periods};

/// Test current as a share of the rated peak current. The torque of a smaller one would depend on the angle error: 1° turns 1 % to
/// 2 % of the rated current from the d axis into the q axis.
const CURRENT: f32 = 0.2;
/// Largest current, as a share of the current limit.
const MOST: f32 = 0.8;
/// Shortest and longest quarter, s, and number of quarters of the measurement: three times + - - +.
const QUARTER_S: (f32, f32) = (0.1, 0.8);
const QUARTERS: usize = 12;
/// Peak of the speed in the measurement and after the impulse, as shares of the rated speed.
const PEAK: f32 = 0.2;
const IMPULSE: f32 = 0.05;
/// Least share of the variance of the speed that inertia and friction explain.
const EXPLAINED: f32 = 0.9;
/// Change of the speed in 8 ms after the impulse, rms as a share of the speed that it gives, above which the shaft rings. Rigid shafts
/// show 0.004 to 0.054 of it at high flux. Couplings with a resonance of 15 or 30 Hz and 0.7 % damping show 0.07 or more on the motors whose speed
/// loop they make oscillate; one of 60 Hz is not seen, and does not disturb the loop.
const RINGS: f32 = 0.06;
/// The limit is at least this multiple of the change before the impulse, because a noisy speed changes as well (0.11 at low flux).
const OF_NOISE: f32 = 1.5;
/// Shortest and longest impulse of torque, and the time for which the speed is watched after it, s.
const IMPULSE_S: (f32, f32) = (2e-3, 0.05);
const WATCHED_S: f32 = 0.5;

/// State of the step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trial {
    /// Q-axis current, A, duration of a quarter, s, and whether the measurement is made with them.
    amperes: f32,
    quarter_s: f32,
    measures: bool,
    /// Result of the measurement, and deviation of the speed after the impulse as a share of the speed that it gives.
    slope: Option<Slope>,
    ringing: f32,
    /// The same without an impulse.
    noise: f32,
}

impl Commissioning {
    /// Part 0 starts the drive; every further part is a quarter, then a part of the impulse.
    pub(super) fn inertia(&mut self, drive: &TestReport, sums: &mut Collector) -> Answer {
        let (state, most) = (&mut self.state, MOST * self.plate.i_q_limit);
        let trial = &mut state.trial;
        match state.part {
            0 => {
                (state.part, self.found.inertia, self.found.rings) = (1, None, false);
                return Ok(Next::Start);
            }
            _ if let Some(slope) = trial.slope => return self.impulse(slope, most, sums),
            1 if drive.state != State::Torque => return Ok(Next::Wait),
            1 => {
                let amperes = most.min(CURRENT * self.plate.rated);
                *trial = Trial { amperes, quarter_s: QUARTER_S.0, ..Trial::default() };
                sums.begin(Record::Motion);
            }
            part if part > if trial.measures { QUARTERS } else { 4 } => {
                let slope = sums.recorded.motion.slope();
                if trial.measures {
                    (state.part, trial.slope) = (1, Some(slope));
                    return self.impulse(slope, most, sums);
                }
                // The current is doubled if it is too small to overcome the friction. Otherwise the friction is added to it, and a
                // quarter lasts until the wanted peak of the speed.
                let follows = slope.explained >= EXPLAINED && slope.value > 0.0;
                let friction = slope.friction.max(0.0);
                if follows {
                    trial.amperes = most.min(CURRENT * self.plate.rated + friction / slope.value);
                    let acceleration = slope.value * trial.amperes - friction;
                    trial.quarter_s =
                        (PEAK * self.plate.speed / acceleration).clamp(QUARTER_S.0, QUARTER_S.1);
                } else {
                    trial.amperes = most.min(2.0 * trial.amperes);
                }
                trial.measures = follows || trial.amperes >= most;
                state.part = 1;
                sums.begin(Record::Motion);
            }
            _ => {}
        }
        // The quarters follow each other as + - - +.
        let ahead = matches!(state.part % 4, 0 | 1);
        state.until = periods(trial.quarter_s) * state.part as u32;
        state.part += 1;
        Ok(Next::Torque(if ahead { trial.amperes } else { -trial.amperes }))
    }

    /// Watches the speed, gives the shaft an impulse of torque, watches the speed again, and takes it away.
    fn impulse(&mut self, slope: Slope, most: f32, sums: &mut Collector) -> Answer {
        let acceleration = slope.value * most;
        let impulse_s = (IMPULSE * self.plate.speed / acceleration).clamp(IMPULSE_S.0, IMPULSE_S.1);
        let seen = sums.recorded.ringing.deviation() / (acceleration * impulse_s);
        let (amperes, seconds, record) = match self.state.part {
            1 => (0.0, WATCHED_S, Record::Ringing),
            2 => {
                self.state.trial.noise = seen;
                (most, impulse_s, Record::Motion)
            }
            3 => (0.0, WATCHED_S, Record::Ringing),
            4 => {
                self.state.trial.ringing = seen;
                (-most, impulse_s, Record::Motion)
            }
            _ => return self.report_inertia(slope),
        };
        sums.begin(record);
        (self.state.part, self.state.until) = (self.state.part + 1, periods(seconds));
        Ok(Next::Torque(amperes))
    }

    fn report_inertia(&mut self, slope: Slope) -> Answer {
        let (explained, free) = (slope.explained, [Meaning::NotFree; 2]);
        let Trial { ringing, noise, .. } = self.state.trial;
        let rings = RINGS.max(OF_NOISE * noise);
        let explained = Quantity::new("explained share of the speed", "", explained)
            .checked((EXPLAINED, 1.0), free)?;
        // The inertia is mechanical, the slopes are electrical.
        let inertia = self.plate.torque_per_ampere * self.plate.pole_pairs_in_force / slope.value;
        let friction = inertia * slope.friction / self.plate.pole_pairs_in_force;
        let values = [
            Quantity::new("inertia", "kg m2", inertia).checked((0.0, f32::INFINITY), free)?,
            Quantity::new("friction", "Nm", friction),
            Quantity::new("q-axis current", "A", self.state.trial.amperes),
            explained,
            Quantity::new("ringing after an impulse", "", ringing).allowing((0.0, rings)),
        ];
        (self.found.inertia, self.found.rings) = (Some(inertia), ringing > rings);
        self.report(&values)
    }
}
