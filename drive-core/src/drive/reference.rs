//! The current that is regulated, by state, within what the dc link allows.

use super::Drive;
use crate::dc_link::Limiting;
use crate::drive::state::{Mode, State};
use crate::math::angle::{Angle, UnitVector};
use crate::math::frames::Dq;
use crate::math::limited;
use crate::motion::Goal;

/// References of the running mode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct References {
    pub(super) current: Dq,
    /// Mechanical turns/s.
    pub(super) speed: f32,
    /// Periods for which the speed holds where it is a jog; 0 where it is none.
    pub(super) jog: u32,
    /// Mechanical turns; `None`: where the drive was started.
    pub(super) turns: Option<f32>,
    /// Largest torque current with which position mode presses on at the speed, A; `None`: it goes to the position.
    pub(super) press: Option<f32>,
    /// Added to the voltage of the current loop, V.
    pub(super) test_voltage: Dq,
    /// Injection axis seen from the frame.
    pub(super) injection_axis: UnitVector,
    /// Lead of the flux before the frame, as an angle and a unit vector: 0 but while the drive learns.
    pub(super) lead: Angle,
    pub(super) lead_axis: UnitVector,
}

impl References {
    /// The reference of the speed, turns/s, in a period: a jog that is not repeated ends.
    fn speed_now(&mut self) -> f32 {
        if self.jog > 0 {
            self.jog -= 1;
            if self.jog == 0 {
                self.speed = 0.0;
            }
        }
        self.speed
    }
}

impl Drive {
    /// The current to regulate in this state, A; moves on to the next state where it is time.
    ///
    /// # Errors
    /// The state to go to with the outputs off: a fault, or off where it has stopped.
    pub(super) fn reference(&mut self) -> Result<Dq, State> {
        let r = &mut self.control.references;
        let i_q = match self.state {
            State::Catching => return Ok(self.catch()?),
            State::Magnetising => return Ok(self.magnetise()?),
            State::Verifying => return Ok(self.verify()?),
            State::Learning => self.learn()?,
            State::Speed | State::Position | State::Braking => self.follow(),
            State::Stopping => {
                let ramp = self.c.sequence.stop_ramp;
                r.current.q = if r.current.q > ramp {
                    r.current.q - ramp
                } else if r.current.q < -ramp {
                    r.current.q + ramp
                } else {
                    return Err(State::Off);
                };
                r.current.q
            }
            _ => r.current.q,
        };
        let s = &mut self.control;
        let (i_d, most) = (s.references.current.d, s.voltage_limit.most.d);
        let (i_q, why) = s.limits.hold(i_q);
        s.limiting = why;
        Ok(Dq { d: if i_d < most { i_d } else { most } + s.limits.flux_a, q: i_q })
    }

    /// The torque current of the speed or the position loop, A.
    fn follow(&mut self) -> f32 {
        let s = &mut self.control;
        let (r, mut range) = (&mut s.references, s.limits.i_q);
        let goal = match (self.state, self.mode, r.press) {
            (State::Braking, ..) => Goal::Rest { quick: s.quick_stop },
            (_, Mode::Speed, _) => Goal::Speed(r.speed_now()),
            (_, _, Some(most)) => {
                range = (limited(range.0, most), limited(range.1, most));
                Goal::Speed(r.speed)
            }
            _ => Goal::Position(r.turns.unwrap_or(0.0)),
        };
        let i_q = self.c.motion.step(&mut s.motion, goal, s.seen.rotor_count, range);
        s.references.current.q = i_q;
        if self.state == State::Braking && self.c.motion.is_at_rest(&s.motion) {
            self.enter(State::Stopping);
        }
        i_q
    }

    /// Duty of the brake chopper, 0 to 1, for the period of the compare values.
    pub fn brake_duty(&self) -> f32 {
        if self.state.is_energised() { self.control.limits.chopper } else { 0.0 }
    }

    /// Tracked stator resistance relative to the settings, less one; only while an observer tracks it.
    pub fn stator_resistance(&self) -> Option<f32> {
        let tracks = self.c.observer.is_some() && self.state.has_torque();
        tracks.then_some(self.control.observer.resistance)
    }

    /// Why the torque is smaller than asked for.
    pub fn limiting(&self) -> Limiting {
        let acts = self.state.has_torque() || self.state.has_frequency();
        if acts { self.control.limiting } else { Limiting::No }
    }
}
