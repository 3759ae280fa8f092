//! Ways to stop, and the start that turns a stop round.

use crate::io::PERIOD_S;

use super::{Common, Drive, End, Field, FluxPhase, Goal, Phase, Start};
use crate::drive::command::{Accepted, Refused, Stop};
use crate::{AngleLoop, Coefficients};

/// Longest time from a stop by [`Stop::Coast`] until the outputs are off, s. Together with the times of the contact, the main loop and the
/// command it stays below the 200 ms that the manual states.
pub const COAST_S: f32 = 0.15;
/// That time in control periods.
pub(super) const COAST: u32 = (COAST_S / PERIOD_S + 0.5) as u32;

impl<L: AngleLoop> Drive<L> {
    pub(super) fn stop(&mut self, stop: Stop) {
        match (&mut self.phase, stop) {
            (Phase::Off(_) | Phase::Fault(..), _) => {}
            (_, Stop::Now)
            | (Phase::Prepare(_) | Phase::Test(_), _)
            | (Phase::Scalar(_), Stop::Coast) => self.end(End::Stopped),
            (Phase::Scalar(scalar), Stop::Ramp | Stop::Quick) => {
                if scalar.stop.is_none() {
                    self.kept.elapsed = 0;
                }
                scalar.stop = Some(scalar.stop == Some(true) || stop == Stop::Quick);
            }
            (Phase::Field(field), _) => self.c.stop_field(field, &mut self.kept, stop),
        }
    }

    /// Turns a stop round: the drive goes on from the speed of the shaft, with the reference of a start, which is speed or torque 0, or
    /// the position in which the shaft comes to rest.
    ///
    /// # Errors
    /// [`Refused::State`] if the drive does not stop, or stops before it has found the angle, or stops from another kind of control.
    pub(super) fn turn_round(&mut self, start: &Start) -> Result<Accepted, Refused> {
        match (&mut self.phase, start) {
            (Phase::Scalar(scalar), Start::Scalar { .. }) if scalar.stop.is_some() => {
                (scalar.stop, scalar.speed) = (None, 0.0);
            }
            (Phase::Field(field), Start::Field(goal)) if goal.regulates() && field.may_go_on() => {
                self.c.go_on(field, &mut self.kept, *goal);
            }
            _ => return Err(Refused::State(self.state())),
        }
        Ok(Accepted::AsGiven)
    }
}

impl<S> Field<S> {
    /// Whether the drive stops, and knows the angle of the flux.
    fn may_go_on(&self) -> bool {
        match self.goal {
            Goal::Brake { .. } | Goal::Hold { .. } => true,
            Goal::Release { regulated } => regulated,
            Goal::Torque | Goal::Speed { .. } | Goal::Position { .. } | Goal::Learn => false,
        }
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Regulates again during a stop.
    fn go_on(&self, s: &mut Field<L::State>, k: &mut Common, goal: Goal) {
        if let Goal::Release { .. } = s.goal {
            self.take_over(s, k);
        }
        s.goal = goal;
        match &mut s.goal {
            Goal::Position { turns, .. } => {
                *turns = Some(self.motion.stopping_point(&s.motion, k.rotor_count));
            }
            Goal::Torque => k.references.current.q = 0.0,
            _ => {}
        }
        s.enter(k, FluxPhase::ready());
    }

    /// Lets the speed loop take over at the present speed and q-axis current.
    fn take_over(&self, s: &mut Field<L::State>, k: &Common) {
        let speed = k.seen.rotor_freq / self.freq_per_speed;
        let (i_q, _) = k.limits.now.clamp(k.references.current.q);
        self.motion.take_over(&mut s.motion, k.rotor_count, speed, i_q);
    }

    fn stop_field(&self, s: &mut Field<L::State>, k: &mut Common, stop: Stop) {
        match (&mut s.goal, stop) {
            (Goal::Release { .. } | Goal::Hold { .. }, _) | (Goal::Brake { .. }, Stop::Ramp) => {
                return;
            }
            (Goal::Brake { quick }, Stop::Quick) => {
                *quick = true;
                return;
            }
            _ => {}
        }
        let regulates = s.regulates();
        let brakes = regulates && matches!(stop, Stop::Ramp | Stop::Quick);
        // The brake begins to close at once, and the drive holds the shaft until it has closed.
        let holds = !brakes && s.has_torque() && k.brake > 0;
        if regulates && (brakes || holds) {
            self.take_over(s, k);
        }
        // A torque that was commanded during the start has not been applied yet, and is cancelled.
        if !matches!(s.flux, FluxPhase::Ready(_) | FluxPhase::Learn(_)) {
            k.references.current.q = 0.0;
        }
        s.goal = match (brakes, holds) {
            (true, _) => Goal::Brake { quick: stop == Stop::Quick },
            (_, true) => Goal::Hold { left: k.brake },
            _ => Goal::Release { regulated: regulates },
        };
        s.enter(k, FluxPhase::ready());
    }
}
