//! The state of the drive under the names of CiA 402 (IEC 61800-7-201).

use drive_core::{Stage, State};

use crate::settings::{Commander, FirmwareSettings};

/// A state of the CiA 402 state machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Power {
    /// The control does not run.
    #[default]
    NotReadyToSwitchOn,
    /// Off, and the bus cannot start the drive.
    SwitchOnDisabled,
    /// Off; a run command starts the drive.
    ReadyToSwitchOn,
    /// The start is under way.
    SwitchedOn,
    /// The drive regulates, learns or measures.
    OperationEnabled,
    /// The drive is stopping.
    QuickStopActive,
    /// Off with a latched fault.
    Fault,
}

impl Power {
    /// All states, in the order of the state machine, each with its name in the standard and bits 0 to 3, 5 and 6 of the status word.
    pub const ALL: [(Self, &str, u16); 7] = [
        (Self::NotReadyToSwitchOn, "not ready to switch on", 0x00),
        (Self::SwitchOnDisabled, "switch on disabled", 0x40),
        (Self::ReadyToSwitchOn, "ready to switch on", 0x21),
        (Self::SwitchedOn, "switched on", 0x23),
        (Self::OperationEnabled, "operation enabled", 0x27),
        (Self::QuickStopActive, "quick stop active", 0x07),
        (Self::Fault, "fault", 0x08),
    ];

    /// The state of a drive with these settings. Off, it is ready if a run command of the bus may start it.
    pub fn of(state: Option<State>, settings: &FirmwareSettings) -> Self {
        let startable =
            settings.command.commander == Commander::Bus && settings.board_is_confirmed();
        match state.map(State::stage) {
            None => Self::NotReadyToSwitchOn,
            Some(Stage::Off) if startable => Self::ReadyToSwitchOn,
            Some(Stage::Off) => Self::SwitchOnDisabled,
            Some(Stage::Starting) => Self::SwitchedOn,
            Some(Stage::Running) => Self::OperationEnabled,
            Some(Stage::Stopping) => Self::QuickStopActive,
            Some(Stage::Fault) => Self::Fault,
        }
    }

    /// Name in the standard.
    pub const fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// Bits 0 to 3, 5 and 6 of the status word.
    pub const fn bits(self) -> u16 {
        Self::ALL[self as usize].2
    }
}
