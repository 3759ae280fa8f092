//! Rules in which state which command is accepted, independent of its value. [Control law](../../../docs/control-law.md) has the
//! table.

use crate::drive::command::{Command, Refused};
use crate::drive::state::{Mode, Stage, State};

/// Modes that regulate torque, speed or position.
const REGULATING: &[Mode] = &[Mode::Torque, Mode::Speed, Mode::Position];

/// States in which a command is accepted.
struct Taken {
    off: bool,
    fault: bool,
    /// Whether it is accepted in the states before [`State::of_mode`], for these modes.
    starting: bool,
    modes: &'static [Mode],
}

impl Taken {
    const OFF: Self = Self { off: true, fault: false, starting: false, modes: &[] };

    const fn running(modes: &'static [Mode]) -> Self {
        Self { off: false, modes, ..Self::OFF }
    }

    /// Accepts the command from the start command on.
    const fn from_start(modes: &'static [Mode]) -> Self {
        Self { starting: true, ..Self::running(modes) }
    }
}

/// Checks that `command` is accepted in `state` of a drive that was started in `mode`.
///
/// # Errors
/// The state or the latched fault that refuses the command.
pub(super) fn allowed<L>(command: &Command<L>, state: State, mode: Mode) -> Result<(), Refused> {
    let taken = match command {
        // In the states off and stopping these commands change nothing.
        Command::Stop(_) | Command::Clear | Command::MotorTemperature(_) => return Ok(()),
        Command::Start(_) | Command::CheckWiring | Command::Brake(_) => Taken::OFF,
        Command::Configure(_) => Taken { fault: true, ..Taken::OFF },
        Command::Test(_) => Taken { modes: &[Mode::Commissioning], ..Taken::OFF },
        Command::Relock => Taken::running(REGULATING),
        Command::Torque(_) => Taken::from_start(&[Mode::Torque]),
        Command::Speed(_) => Taken::from_start(&[Mode::Speed, Mode::VoltsPerHertz]),
        Command::Jog(_) => Taken::running(&[Mode::Speed]),
        Command::Position(_) => Taken::from_start(&[Mode::Position]),
        Command::Press(..) | Command::Home(_) => Taken::running(&[Mode::Position]),
        Command::Magnetising(_)
        | Command::TurnInjection(_)
        | Command::TestVoltage(_)
        | Command::RotorTimeConstant(_) => Taken::from_start(REGULATING),
    };
    let of_mode = taken.modes.contains(&mode);
    let is_taken = match (state, state.stage()) {
        (State::Fault(fault), _) if !taken.fault => return Err(Refused::Fault(fault)),
        (_, Stage::Fault) => true,
        (_, Stage::Off) => taken.off,
        (_, Stage::Starting) if taken.starting && !of_mode => {
            return Err(Refused::State(State::of_mode(mode)));
        }
        (_, Stage::Starting) => taken.starting,
        (_, Stage::Running) => of_mode,
        // A start turns a stop round.
        (_, Stage::Stopping) => match command {
            Command::Start(Mode::VoltsPerHertz) => state == State::BrakingByFrequency,
            Command::Start(mode) => REGULATING.contains(mode) && state != State::BrakingByFrequency,
            _ => false,
        },
    };
    if is_taken { Ok(()) } else { Err(Refused::State(state)) }
}
