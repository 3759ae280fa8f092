//! Execution of the commands: they are accepted, limited or refused, depending on the state.

use super::{Drive, Field, FluxPhase, Frame, Goal, Phase, Start};
use super::{allowed::allowed, brake::BRAKE_MAX_S, prepare::Prepare, scalar::Scalar};

use crate::drive::command::{Accepted, Command, Refused};
use crate::drive::state::Mode;
use crate::io::PERIOD_S;
use crate::math::limited;
use crate::protect::lock_monitor::LockMonitorState;
use crate::{Angle, AngleLoop, AngleSource};

/// Periods for which a jog continues: 0.5 s.
const JOG: u32 = 3000;

impl<L: AngleLoop> Drive<L> {
    /// Executes a command, see [`Drive::command`].
    ///
    /// # Errors
    /// See [`Drive::command`].
    #[doc(hidden)]
    pub fn execute(&mut self, command: &Command<L>) -> Result<Accepted, Refused> {
        allowed(command, self.state_now(), self.mode())?;
        match *command {
            Command::Start(mode) => {
                return self.start(Start::of_mode(mode).ok_or(Refused::NotBuilt)?);
            }
            Command::Relock => self.relock()?,
            Command::CheckWiring => self.kept.wiring_unchecked = true,
            Command::Brake(seconds) => {
                in_range(seconds, 0.0, BRAKE_MAX_S)?;
                self.kept.brake = (seconds / PERIOD_S) as u32;
            }
            Command::Test(wanted) => return self.take_test(wanted),
            Command::Stop(stop) => self.stop(stop),
            Command::Clear => {
                if let Phase::Fault(_, left) = self.phase {
                    self.enter(Phase::Off(left));
                }
            }
            Command::Torque(i_q) => {
                finite(i_q)?;
                let current = &mut self.kept.references.current;
                let largest = self.c.voltage_limit.beside(current.d);
                current.q = limited(limited(i_q, largest), self.c.protection.i_q);
                return Ok(accepted(i_q, current.q));
            }
            Command::Speed(rpm) => return self.set_speed(rpm, 0),
            Command::Jog(rpm) => return self.set_speed(rpm, JOG),
            Command::Position(to) => {
                finite(to)?;
                let taken = limited(to, self.c.motion.position_limit);
                if let Some(Goal::Position { press: Some(_), .. }) = self.goal() {
                    self.hold_present_position();
                }
                if let Some(Goal::Position { turns, .. }) = self.goal() {
                    *turns = Some(taken);
                }
                return Ok(accepted(to, taken));
            }
            Command::Press(rpm, i_q) => {
                finite(rpm)?;
                let max = self.c.protection.i_q;
                in_range(i_q, 0.0, max)?;
                self.hold_present_position();
                let taken = limited(rpm, self.c.motion.speed_limit * 60.0);
                if let Some(Goal::Position { press, .. }) = self.goal() {
                    *press = Some((taken / 60.0, i_q));
                }
                return Ok(accepted(rpm, taken));
            }
            Command::Home(here) => {
                finite(here)?;
                let max = self.c.motion.position_limit;
                in_range(here, -max, max)?;
                self.hold_present_position();
                if let Phase::Field(field) = &mut self.phase {
                    let origin = self.c.motion.shift_origin(&mut field.motion, here);
                    if let Goal::Position { turns, press, .. } = &mut field.goal {
                        (*turns, *press) = (Some(0.0), None);
                    }
                    self.kept.home = (self.c.source == AngleSource::Encoder).then_some(origin);
                }
            }
            Command::Magnetising(i_d) => {
                finite(i_d)?;
                // The tables and the monitor are valid for one d-axis current only.
                if self.c.lock_monitor.is_some() {
                    return Err(Refused::FluxIsFixed);
                }
                let current = &mut self.kept.references.current;
                let min = 0.2 * self.c.voltage_limit.i_d;
                let max = self.c.voltage_limit.beside(current.q);
                if i_d < min {
                    return Err(Refused::OutOfRange { min, max });
                }
                current.d = limited(i_d, max);
                return Ok(accepted(i_d, current.d));
            }
            Command::TurnInjection(degrees) => {
                finite(degrees)?;
                if self.c.source != AngleSource::Encoder {
                    return Err(Refused::NeedsEncoder);
                }
                let turn = self.c.injection_turn + Angle::from_degrees(degrees);
                self.kept.references.injection_axis = turn.unit_vector();
            }
            Command::TestVoltage(voltage) => {
                finite(voltage.d)?;
                finite(voltage.q)?;
                let max = self.c.largest_test_v;
                in_range(voltage.d, -max, max)?;
                in_range(voltage.q, -max, max)?;
                self.kept.references.test_voltage = voltage;
            }
            Command::RotorTimeConstant(tau_r) => {
                if !self.c.track_rotor {
                    return Err(Refused::RotorNotTracked);
                }
                finite(tau_r)?;
                let taken = self.c.indirect.track_tau_r(tau_r);
                let taken = taken.map_err(|[min, max]| Refused::OutOfRange { min, max })?;
                self.changes = self.changes.wrapping_add(1);
                return Ok(accepted(tau_r, taken));
            }
            Command::MotorTemperature(reading) => self.take_motor_temperature(reading),
            Command::Configure(ref coefficients) => {
                self.c = *coefficients;
                let limits = &mut self.kept.limits;
                (limits.motor_hot, limits.motor_fault) = (0, self.c.no_motor_reading());
                self.kept.home = None;
                self.changes = self.changes.wrapping_add(1);
            }
        }
        Ok(Accepted::AsGiven)
    }

    /// Returns the mode in which the drive was started. The mode of a drive that is off or stops is never used.
    pub(super) fn mode(&self) -> Mode {
        match &self.phase {
            Phase::Off(_) | Phase::Fault(..) => Mode::Torque,
            Phase::Prepare(prepare) => prepare.job.mode(),
            Phase::Test(_) => Mode::Commissioning,
            Phase::Scalar(_) => Mode::VoltsPerHertz,
            Phase::Field(field) => field.goal.mode(),
        }
    }

    /// Returns the goal of the current control, with its reference.
    fn goal(&mut self) -> Option<&mut Goal> {
        match &mut self.phase {
            Phase::Prepare(Prepare { job: Start::Field(goal), .. })
            | Phase::Field(Field { goal, .. }) => Some(goal),
            Phase::Off(_) | Phase::Fault(..) | Phase::Test(_) => None,
            Phase::Prepare(_) | Phase::Scalar(_) => None,
        }
    }

    /// Sets the speed reference; the speed of a jog is valid for so many periods.
    fn set_speed(&mut self, rpm: f32, periods: u32) -> Result<Accepted, Refused> {
        finite(rpm)?;
        let taken = limited(rpm, self.c.motion.speed_limit * 60.0);
        match &mut self.phase {
            Phase::Prepare(Prepare { job: Start::Scalar { speed, .. }, .. })
            | Phase::Scalar(Scalar { speed, .. }) => *speed = taken / 60.0,
            _ => {
                if let Some(Goal::Speed { speed, jog }) = self.goal() {
                    (*speed, *jog) = (taken / 60.0, periods);
                }
            }
        }
        Ok(accepted(rpm, taken))
    }

    /// Restarts the position loop at the present position of the shaft, without torque.
    fn hold_present_position(&mut self) {
        if let Phase::Field(field) = &mut self.phase {
            let count = self.kept.rotor_count;
            self.c.motion.take_over(&mut field.motion, count, 0.0, 0.0);
        }
        if let Some(Goal::Position { press, .. }) = self.goal() {
            *press = None;
        }
    }

    pub(super) fn start(&mut self, job: Start) -> Result<Accepted, Refused> {
        if !self.is_off() {
            return self.turn_round(&job);
        }
        if let Some(fault) = self.kept.limits.motor_fault {
            return Err(Refused::Stands(fault));
        }
        match &job {
            _ if !self.is_charged() => Err(Refused::NotCharged),
            Start::Field(Goal::Learn) if !self.can_learn() => Err(Refused::NeedsInjection),
            Start::Scalar { .. } if self.c.volts_per_hertz.is_none() => Err(Refused::Nameplate),
            Start::Field(goal) if goal.regulates() && self.c.unlearned => Err(Refused::NotLearned),
            Start::Field(_) | Start::Scalar { .. } | Start::Test(_) => Ok(()),
        }?;
        self.prepare_for(job);
        Ok(Accepted::AsGiven)
    }

    /// Magnetises again along phase a, like a start at rest, while the current continues to flow.
    fn relock(&mut self) -> Result<(), Refused> {
        let (c, k) = (&self.c, &mut self.kept);
        let Phase::Field(field) = &mut self.phase else { return Ok(()) };
        if field.frame != Frame::Tracked {
            return Err(Refused::NeedsInjection);
        }
        if !c.is_at_standstill(k) {
            return Err(Refused::Turning);
        }
        k.no_torque(k.references.current.d, c.injection_axis);
        match &mut field.goal {
            goal @ Goal::Speed { .. } => *goal = Goal::SPEED,
            Goal::Position { turns, press, .. } => (*turns, *press) = (None, None),
            Goal::Torque | Goal::Learn => {}
            Goal::Brake { .. } | Goal::Hold { .. } | Goal::Release => {}
        }
        c.estimator.start(&mut field.estimator);
        field.lock = LockMonitorState::default();
        field.enter(k, FluxPhase::Hold);
        Ok(())
    }
}

fn finite(value: f32) -> Result<(), Refused> {
    if value.is_finite() { Ok(()) } else { Err(Refused::NotFinite) }
}

/// Refuses a value that is not within `min` to `max`.
fn in_range(value: f32, min: f32, max: f32) -> Result<(), Refused> {
    if (min..=max).contains(&value) { Ok(()) } else { Err(Refused::OutOfRange { min, max }) }
}

fn accepted(asked: f32, taken: f32) -> Accepted {
    if asked == taken { Accepted::AsGiven } else { Accepted::Limited(taken) }
}
