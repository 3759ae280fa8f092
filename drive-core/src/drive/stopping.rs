//! Ways to stop, and the start that turns a stop round.

use crate::io::PERIOD_S;

use super::{Common, Drive, End, Field, FluxPhase, Frame, Goal, Phase, Start};
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
            // The angle of the flux is not known yet.
            (Phase::Field(Field { flux, .. }), _) if !flux.is_known() => self.end(End::Stopped),
            (Phase::Field(field), _) => self.c.stop_field(field, &mut self.kept, stop),
        }
    }

    /// Turns a stop round: the drive goes on from the speed of the shaft, with the reference of a start, which is speed or torque 0, or
    /// the position in which the shaft can come to rest. [`allowed`](super::allowed) has seen that it stops, and from this kind of control.
    ///
    /// # Errors
    /// [`Refused::State`] if it stops from a self-commissioning.
    pub(super) fn turn_round(&mut self, start: &Start) -> Result<Accepted, Refused> {
        let (c, k) = (&self.c, &mut self.kept);
        match (&mut self.phase, start) {
            (Phase::Scalar(scalar), _) => (scalar.stop, scalar.speed) = (None, 0.0),
            (Phase::Field(field), Start::Field(goal)) if field.frame != Frame::LockedShaft => {
                c.take_over(field, k);
                (field.goal, k.references.current.q) = (*goal, 0.0);
                if let Goal::Position { turns, .. } = &mut field.goal {
                    *turns = Some(c.motion.stopping_point(&field.motion, k.rotor_count));
                }
                field.enter(k, FluxPhase::ready());
            }
            _ => return Err(Refused::State(self.present_state())),
        }
        Ok(Accepted::AsGiven)
    }
}

impl<L: AngleLoop> Coefficients<L> {
    /// Lets the speed loop take over at the present speed and q-axis current.
    fn take_over(&self, s: &mut Field<L::State>, k: &Common) {
        let speed = k.seen.rotor_freq / self.freq_per_speed;
        let (i_q, _) = k.limits.now.clamp(k.references.current.q);
        self.motion.take_over(&mut s.motion, k.rotor_count, speed, i_q);
    }

    fn stop_field(&self, s: &mut Field<L::State>, k: &mut Common, stop: Stop) {
        match (&mut s.goal, stop) {
            (Goal::Release | Goal::Hold { .. }, _) => return,
            (Goal::Brake { .. }, Stop::Ramp) => return,
            (Goal::Brake { quick }, Stop::Quick) => return *quick = true,
            _ => {}
        }
        let regulates = s.regulates();
        let brakes = regulates && matches!(stop, Stop::Ramp | Stop::Quick);
        // The brake begins to close at once, and the drive holds the shaft until it has closed.
        let holds = !brakes && s.has_torque() && k.brake > 0;
        if regulates && (brakes || holds) {
            self.take_over(s, k);
        }
        s.goal = match (brakes, holds) {
            (true, _) => Goal::Brake { quick: stop == Stop::Quick },
            (_, true) => Goal::Hold { left: k.brake },
            _ => Goal::Release,
        };
        s.enter(k, FluxPhase::ready());
    }
}
