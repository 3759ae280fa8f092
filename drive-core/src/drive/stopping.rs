//! The ways to stop.

use super::Drive;
use crate::drive::command::Stop;
use crate::drive::state::{Mode, State};

impl Drive {
    pub(super) fn stop(&mut self, stop: Stop) {
        match (self.state, stop) {
            (State::Off | State::Fault(_) | State::Stopping, _) | (State::Braking, Stop::Ramp) => {}
            (
                State::Calibrating | State::Precharge | State::CheckingWiring | State::Exciting,
                _,
            ) => self.enter(State::Off),
            (State::VoltsPerHertz, Stop::Ramp | Stop::Quick) => self.enter(State::Braking),
            _ if self.mode == Mode::VoltsPerHertz => self.enter(State::Off),
            (State::Braking, Stop::Quick) => self.control.quick_stop = true,
            (state, Stop::Ramp | Stop::Quick) if state.regulates() => self.brake_from_here(stop),
            _ => self.enter(State::Stopping),
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
