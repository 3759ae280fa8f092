//! The commands: accepted, limited or refused, depending on the state.

use super::reference::References;
use super::{ControlState, Drive};

use crate::drive::allowed::allowed;
use crate::drive::coefficients::Coefficients;
use crate::drive::command::{Accepted, Command, Refused};
use crate::drive::state::{Mode, State};
use crate::math::angle::Angle;
use crate::math::frames::Dq;
use crate::math::limited;
use crate::protect::lock_monitor::LockMonitorState;
use crate::settings::AngleSource;

/// Periods for which a jog goes on: 0.5 s.
const JOG: u32 = 3000;

impl Drive {
    /// Takes a command; not from within [`step`](Self::step), but between two steps.
    ///
    /// References are accepted from the start command on, and a start sets them to zero: references of an
    /// earlier run move nothing.
    ///
    /// # Errors
    /// The reason of the refusal; nothing has changed then.
    // Not inlined: it stays in the flash.
    #[inline(never)]
    pub fn command(&mut self, command: &Command) -> Result<Accepted, Refused> {
        allowed(command, self.state, self.mode)?;
        match *command {
            Command::Start(mode) => self.start(mode),
            Command::Relock => self.relock(),
            Command::CheckWiring => {
                self.wiring_unchecked = true;
                Ok(Accepted::AsGiven)
            }
            Command::Excite(excitation) => self.take_excitation(excitation),
            Command::Stop(stop) => {
                self.stop(stop);
                Ok(Accepted::AsGiven)
            }
            Command::Clear => {
                if let State::Fault(_) = self.state {
                    self.enter(State::Off);
                }
                Ok(Accepted::AsGiven)
            }
            Command::Torque(i_q) => {
                finite(i_q)?;
                let i_d = self.control.references.current.d;
                let largest = libm::sqrtf(self.c.protection.current_squared - i_d * i_d);
                let taken = limited(limited(i_q, largest), self.c.protection.i_q);
                self.control.references.current.q = taken;
                Ok(accepted(i_q, taken))
            }
            Command::Speed(rpm) => self.turn_at(rpm, 0),
            Command::Jog(rpm) => self.turn_at(rpm, JOG),
            Command::Position(turns) => {
                finite(turns)?;
                let taken = limited(turns, self.c.motion.position_limit);
                if self.control.references.press.is_some() {
                    self.rest_here();
                }
                self.control.references.turns = Some(taken);
                Ok(accepted(turns, taken))
            }
            Command::Press(rpm, i_q) => {
                finite(rpm)?;
                let max = self.c.protection.i_q;
                if !(0.0..=max).contains(&i_q) {
                    return Err(Refused::OutOfRange { min: 0.0, max });
                }
                self.rest_here();
                let taken = limited(rpm, self.c.motion.speed_limit * 60.0);
                let r = &mut self.control.references;
                (r.speed, r.press) = (taken / 60.0, Some(i_q));
                Ok(accepted(rpm, taken))
            }
            Command::Home(turns) => {
                finite(turns)?;
                let max = self.c.motion.position_limit;
                if turns.abs() > max {
                    return Err(Refused::OutOfRange { min: -max, max });
                }
                self.rest_here();
                let s = &mut self.control;
                let origin = self.c.motion.shift_origin(&mut s.motion, turns);
                s.references.turns = Some(0.0);
                self.home = (self.c.source == AngleSource::Encoder).then_some(origin);
                Ok(Accepted::AsGiven)
            }
            Command::Magnetising(i_d) => {
                finite(i_d)?;
                // Tables and monitor are those of one direct current.
                if self.c.lock_monitor.is_some() {
                    return Err(Refused::FluxIsFixed);
                }
                let i_q = self.control.references.current.q;
                let min = 0.2 * self.c.sequence.i_d;
                let max = libm::sqrtf(self.c.protection.current_squared - i_q * i_q);
                if i_d < min {
                    return Err(Refused::OutOfRange { min, max });
                }
                let taken = limited(i_d, max);
                self.control.references.current.d = taken;
                Ok(accepted(i_d, taken))
            }
            Command::TurnInjection(degrees) => {
                finite(degrees)?;
                if self.c.source != AngleSource::Encoder {
                    return Err(Refused::NeedsEncoder);
                }
                let turn = self.c.injection_turn + Angle::from_degrees(degrees);
                self.control.references.injection_axis = turn.unit_vector();
                Ok(Accepted::AsGiven)
            }
            Command::TestVoltage(voltage) => {
                finite(voltage.d + voltage.q)?;
                let max = self.c.largest_test_v;
                let inside = |x: f32| (-max..=max).contains(&x);
                if !(inside(voltage.d) && inside(voltage.q)) {
                    return Err(Refused::OutOfRange { min: -max, max });
                }
                self.control.references.test_voltage = voltage;
                Ok(Accepted::AsGiven)
            }
            Command::RotorTimeConstant(tau_r) => {
                if !self.c.track_rotor {
                    return Err(Refused::RotorNotTracked);
                }
                finite(tau_r)?;
                let taken = self
                    .c
                    .indirect
                    .track_tau_r(tau_r)
                    .map_err(|[min, max]| Refused::OutOfRange { min, max })?;
                self.changes = self.changes.wrapping_add(1);
                Ok(accepted(tau_r, taken))
            }
            Command::Configure(ref coefficients) => {
                self.configure(coefficients);
                Ok(Accepted::AsGiven)
            }
        }
    }

    /// Takes the speed, for so many periods where it is a jog.
    fn turn_at(&mut self, rpm: f32, jog: u32) -> Result<Accepted, Refused> {
        finite(rpm)?;
        let taken = limited(rpm, self.c.motion.speed_limit * 60.0);
        let r = &mut self.control.references;
        (r.speed, r.jog) = (taken / 60.0, jog);
        Ok(accepted(rpm, taken))
    }

    /// Lets the position loop begin anew where the shaft is, without torque.
    fn rest_here(&mut self) {
        let s = &mut self.control;
        self.c.motion.take_over(&mut s.motion, s.seen.rotor_count, 0.0, 0.0);
        s.references.press = None;
    }

    fn configure(&mut self, coefficients: &Coefficients) {
        self.c = *coefficients;
        self.home = None;
        self.changes = self.changes.wrapping_add(1);
    }

    pub(super) fn start(&mut self, mode: Mode) -> Result<Accepted, Refused> {
        match mode {
            _ if !self.is_charged() => return Err(Refused::NotCharged),
            Mode::Learning if !self.can_learn() => return Err(Refused::NeedsInjection),
            Mode::VoltsPerHertz if self.c.volts_per_hertz.is_none() => {
                return Err(Refused::Nameplate);
            }
            Mode::Torque | Mode::Speed | Mode::Position if self.c.unlearned => {
                return Err(Refused::NotLearned);
            }
            Mode::Torque | Mode::Speed | Mode::Position => {}
            Mode::Learning | Mode::Commissioning | Mode::VoltsPerHertz => {}
        }
        let flux_left = self.flux_left();
        self.mode = mode;
        self.starts = self.starts.wrapping_add(1);
        if mode == Mode::Learning {
            self.learned = None;
        }
        // The brake resistor stays hot; a start on a turning shaft measures neither drop nor carrier.
        let ControlState { dc_link, inverter_drop, observer, lock, .. } = self.control;
        self.control = ControlState { dc_link, ..ControlState::default() };
        self.control.inverter_drop.volts = inverter_drop.volts;
        self.control.observer.resistance = observer.resistance;
        self.control.lock.baseline = lock.baseline;
        self.control.catching.flux_left = flux_left.filter(|_| self.can_catch());
        let by_voltage = self.c.volts_per_hertz.filter(|_| mode == Mode::VoltsPerHertz);
        let i_d = by_voltage.map_or(self.c.sequence.i_d, |turning| turning.boost_a);
        self.control.references = self.no_torque(i_d);
        self.c.turn(&mut self.control.axes, 0.0, self.c.injection_axis, false);
        self.c.sensing.start(&mut self.control.sensing);
        self.c.estimator.start(&mut self.control.estimator);
        self.control.voltage_limit = self.c.voltage_limit.start();
        let most = self.control.voltage_limit.most.q;
        self.control.limits.i_q = (-most, most);
        if let Some(observer) = &self.c.observer {
            observer.start(&mut self.control.observer);
        }
        self.enter(State::Calibrating);
        Ok(Accepted::AsGiven)
    }

    /// Magnetises again along phase a, as a start at rest does, with the current flowing on.
    fn relock(&mut self) -> Result<Accepted, Refused> {
        if self.c.source != AngleSource::Injection {
            return Err(Refused::NeedsInjection);
        }
        if !self.stands() {
            return Err(Refused::Turning);
        }
        self.control.references = self.no_torque(self.control.references.current.d);
        self.c.estimator.start(&mut self.control.estimator);
        self.control.lock = LockMonitorState::default();
        self.enter(State::Magnetising);
        Ok(Accepted::AsGiven)
    }

    /// References of nothing but this direct current, A.
    fn no_torque(&self, i_d: f32) -> References {
        References {
            current: Dq::new(i_d, 0.0),
            injection_axis: self.c.injection_axis,
            ..References::default()
        }
    }
}

fn finite(value: f32) -> Result<(), Refused> {
    if value.is_finite() { Ok(()) } else { Err(Refused::NotFinite) }
}

fn accepted(asked: f32, taken: f32) -> Accepted {
    if asked == taken { Accepted::AsGiven } else { Accepted::Limited(taken) }
}
