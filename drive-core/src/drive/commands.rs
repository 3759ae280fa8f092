//! The commands: what is taken, limited, or refused in which state.

use super::{Drive, References};
use crate::angle::Angle;
use crate::frames::Dq;
use crate::io::{Command, Mode, Refused, Taken};
use crate::sensing::SensingState;
use crate::settings::{AngleSource, LARGEST_POSITION};
use crate::state::State;

impl Drive {
    /// Takes a command; not from within [`step`](Self::step), but between two steps.
    ///
    /// References are taken from the start command on, and a start sets them to zero: what was asked
    /// for in an earlier run moves nothing.
    ///
    /// # Errors
    /// Why it was refused; nothing has changed then.
    pub fn command(&mut self, command: Command) -> Result<Taken, Refused> {
        match command {
            Command::Start(mode) => self.start(mode),
            Command::Stop => {
                match self.state {
                    State::Off | State::Fault(_) | State::Stopping => {}
                    State::Calibrating | State::Precharge => self.enter(State::Off),
                    _ => self.enter(State::Stopping),
                }
                Ok(Taken::AsGiven)
            }
            Command::Clear => {
                if let State::Fault(_) = self.state {
                    self.enter(State::Off);
                }
                Ok(Taken::AsGiven)
            }
            Command::Torque(i_q) => {
                self.takes_references(Mode::Torque, i_q)?;
                let i_d = self.references.current.d;
                let largest = libm::sqrtf(self.c.protection.current_squared - i_d * i_d);
                let taken = limited(i_q, largest);
                self.references.current.q = taken;
                Ok(as_taken(i_q, taken))
            }
            Command::Position(turns) => {
                self.takes_references(Mode::Position, turns)?;
                let taken = limited(turns, LARGEST_POSITION);
                self.references.turns = taken;
                Ok(as_taken(turns, taken))
            }
            Command::Magnetising(i_d) => {
                self.takes_references(self.mode, i_d)?;
                let i_q = self.references.current.q;
                let min = 0.2 * self.c.sequence.i_d;
                let max = libm::sqrtf(self.c.protection.current_squared - i_q * i_q);
                if i_d < min {
                    return Err(Refused::OutOfRange { min, max });
                }
                let taken = limited(i_d, max);
                self.references.current.d = taken;
                Ok(as_taken(i_d, taken))
            }
            Command::TurnInjection(degrees) => {
                self.takes_references(self.mode, degrees)?;
                if self.c.source != AngleSource::Encoder {
                    return Err(Refused::NeedsEncoder);
                }
                let turn = Angle::QUARTER + Angle::from_degrees(degrees);
                self.references.injection_turn = turn;
                self.references.injection_axis = turn.unit_vector();
                Ok(Taken::AsGiven)
            }
            Command::Configure(coefficients) => match self.state {
                State::Off | State::Fault(_) => {
                    self.c = *coefficients;
                    self.sensing = SensingState::default();
                    Ok(Taken::AsGiven)
                }
                state => Err(Refused::State(state)),
            },
        }
    }

    fn start(&mut self, mode: Mode) -> Result<Taken, Refused> {
        match (self.state, mode) {
            (State::Fault(fault), _) => return Err(Refused::Fault(fault)),
            (State::Off, Mode::Speed | Mode::Commissioning) => {
                return Err(Refused::ModeNotAvailable(mode));
            }
            (State::Off, Mode::Position) if self.c.source != AngleSource::Encoder => {
                return Err(Refused::NeedsEncoder);
            }
            (State::Off, Mode::Learning) if !self.can_learn() => {
                return Err(Refused::NeedsInjection);
            }
            (State::Off, _) => {}
            (state, _) => return Err(Refused::State(state)),
        }
        self.mode = mode;
        self.references =
            References { current: Dq::new(self.c.sequence.i_d, 0.0), ..References::default() };
        self.sensing = SensingState::default();
        self.enter(State::Calibrating);
        Ok(Taken::AsGiven)
    }

    /// Whether a reference for `mode` can be taken now.
    fn takes_references(&self, mode: Mode, value: f32) -> Result<(), Refused> {
        match self.state {
            State::Fault(fault) => Err(Refused::Fault(fault)),
            State::Off | State::Stopping => Err(Refused::State(self.state)),
            _ if self.mode != mode || mode == Mode::Learning => {
                Err(Refused::State(State::of_mode(self.mode)))
            }
            _ if !value.is_finite() => Err(Refused::NotFinite),
            _ => Ok(()),
        }
    }
}

fn limited(value: f32, largest: f32) -> f32 {
    if value > largest {
        largest
    } else if value < -largest {
        -largest
    } else {
        value
    }
}

fn as_taken(asked: f32, taken: f32) -> Taken {
    if asked == taken { Taken::AsGiven } else { Taken::Limited(taken) }
}
