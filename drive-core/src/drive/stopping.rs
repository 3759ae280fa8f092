//! Ways to stop.

use crate::io::PERIOD_S;

use super::{Common, Drive, End, Field, FluxPhase, Goal, Phase};
use crate::drive::command::Stop;
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
}

impl<L: AngleLoop> Coefficients<L> {
    fn stop_field(&self, s: &mut Field<L::State>, k: &mut Common, stop: Stop) {
        match (&mut s.goal, stop) {
            (Goal::Release | Goal::Hold { .. }, _) | (Goal::Brake { .. }, Stop::Ramp) => return,
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
            // The speed loop takes over at the present speed and q-axis current.
            let speed = k.seen.rotor_freq / self.freq_per_speed;
            let (i_q, _) = k.limits.now.clamp(k.references.current.q);
            self.motion.take_over(&mut s.motion, k.rotor_count, speed, i_q);
        }
        // A torque that was commanded during the start has not been applied yet, and is cancelled.
        if !matches!(s.flux, FluxPhase::Ready(_) | FluxPhase::Learn(_)) {
            k.references.current.q = 0.0;
        }
        s.goal = match (brakes, holds) {
            (true, _) => Goal::Brake { quick: stop == Stop::Quick },
            (_, true) => Goal::Hold { left: k.brake },
            _ => Goal::Release,
        };
        s.enter(k, FluxPhase::ready());
    }
}
