//! The ways to stop.

use super::Drive;
use crate::drive::command::Stop;
use crate::drive::state::State;

impl Drive {
    pub(super) fn stop(&mut self, stop: Stop) {
        match (self.state, stop) {
            (State::Off | State::Fault(_) | State::Stopping, _)
            | (State::Braking | State::BrakingByFrequency, Stop::Ramp) => {}
            (
                State::Calibrating | State::Precharge | State::CheckingWiring | State::Exciting,
                _,
            )
            | (State::VoltsPerHertz | State::BrakingByFrequency, Stop::Coast) => {
                self.enter(State::Off);
            }
            (State::VoltsPerHertz, Stop::Ramp | Stop::Quick) => {
                self.control.quick_stop = stop == Stop::Quick;
                self.enter(State::BrakingByFrequency);
            }
            (State::Braking | State::BrakingByFrequency, Stop::Quick) => {
                self.control.quick_stop = true;
            }
            (State::Torque | State::Speed | State::Position, Stop::Ramp | Stop::Quick) => {
                self.brake_from_here(stop);
            }
            (State::Catching | State::Magnetising | State::Verifying | State::Learning, _)
            | (State::Torque | State::Speed | State::Position | State::Braking, Stop::Coast) => {
                self.enter(State::Stopping);
            }
        }
    }

    /// Lets the speed loop take over at the present speed and torque current.
    fn brake_from_here(&mut self, stop: Stop) {
        let speed = self.rotor_freq() / self.c.freq_per_speed;
        let s = &mut self.control;
        let (i_q, _) = s.limits.hold(s.references.current.q);
        self.c.motion.take_over(&mut s.motion, s.seen.rotor_count, speed, i_q);
        s.quick_stop = stop == Stop::Quick;
        self.enter(State::Braking);
    }
}
