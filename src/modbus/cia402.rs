//! The state of the drive under the names of CiA 402 (IEC 61800-7-201), and its status word.

use drive_core::{Stage, State, Stop};

use crate::settings::FirmwareSettings;
use crate::settings::bus::Commander;

/// Whether the bus may start a drive with these settings.
pub fn bus_may_start(settings: &FirmwareSettings) -> bool {
    settings.bus.commander == Commander::Bus && settings.board_is_confirmed()
}

/// A state of the CiA 402 state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// The control does not run.
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

    /// The state of a drive; `startable`: see [`bus_may_start`].
    pub fn of(state: Option<State>, startable: bool) -> Self {
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

/// Command bits of the control word.
const SWITCH_ON: u16 = 1 << 0;
const ENABLE_VOLTAGE: u16 = 1 << 1;
/// A quick stop if the bit is 0.
const QUICK_STOP: u16 = 1 << 2;
const ENABLE_OPERATION: u16 = 1 << 3;
/// Bit of the control word: clear the latched fault.
pub const FAULT_RESET: u16 = 1 << 7;

/// The control word that commands a run.
pub const RUN: u16 = SWITCH_ON | ENABLE_VOLTAGE | QUICK_STOP | ENABLE_OPERATION;
/// The control word of a drive that is stopped: shutdown.
pub const SHUTDOWN: u16 = ENABLE_VOLTAGE | QUICK_STOP;

/// The stop that a control word commands; `None` for a run. Disable voltage switches off at once, a quick stop brakes by its own ramp,
/// and shutdown, switch on and disable operation brake by the ramp of the speed.
pub const fn stop(control_word: u16) -> Option<Stop> {
    if control_word & ENABLE_VOLTAGE == 0 {
        Some(Stop::Now)
    } else if control_word & QUICK_STOP == 0 {
        Some(Stop::Quick)
    } else if control_word & RUN == RUN {
        None
    } else {
        Some(Stop::Ramp)
    }
}

/// Bit of the status word: the dc link is above its lower limit.
pub const VOLTAGE_ENABLED: u16 = 1 << 4;
/// Bit of the status word, manufacturer-specific: the drive is off, and the speed is the last measured one.
pub const SPEED_ASSUMED: u16 = 1 << 14;
/// Bit of the status word: the bus commands.
pub const REMOTE: u16 = 1 << 9;
/// Bit of the status word: the speed is within 1 % of `speed.limit_rpm` of its reference.
pub const TARGET_REACHED: u16 = 1 << 10;
