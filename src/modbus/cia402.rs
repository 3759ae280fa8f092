//! The state machine of CiA 402 (IEC 61800-7-201): the effect of a control word in each state. It knows neither a bus nor the drive.

use Event::*;
use Power::*;

/// Bit of the control word: clear the latched fault.
pub const FAULT_RESET: u16 = 1 << 7;

/// Bit of the status word: the dc link is above its lower limit.
pub const VOLTAGE_ENABLED: u16 = 1 << 4;
/// Bit of the status word: the bus commands.
pub const REMOTE: u16 = 1 << 9;
/// Bit of the status word: the speed has reached its reference.
pub const TARGET_REACHED: u16 = 1 << 10;
/// Bit of the status word, as in the mode *profile velocity*: the shaft is at rest.
pub const STANDSTILL: u16 = 1 << 12;
/// Bit of the status word, manufacturer-specific: the drive is off, and the speed is the last measured one.
pub const SPEED_ASSUMED: u16 = 1 << 14;

/// A state of the CiA 402 state machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Power {
    /// The control does not run.
    #[default]
    NotReadyToSwitchOn,
    /// Off; a start needs *shutdown* first, and the bus must command.
    SwitchOnDisabled,
    /// Off; *switch on* or *enable operation* goes on.
    ReadyToSwitchOn,
    /// Off; *enable operation* starts the drive. Also while the start is under way.
    SwitchedOn,
    /// The drive regulates, learns or measures.
    OperationEnabled,
    /// The drive stops, or has stopped and stays in this state.
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

    /// Bits 0 to 3, 5 and 6 of the status word.
    pub const fn bits(self) -> u16 {
        Self::ALL[self as usize].2
    }
}

/// Cause of a transition: a command of the control word, or something that happens to the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Command: the outputs go off at once, and the shaft coasts.
    DisableVoltage,
    /// Command: a quick stop, as its option code says.
    QuickStop,
    /// Command: stop by the ramp of the speed.
    Shutdown,
    /// Command: switch on. While the drive runs, the same bits are *disable operation*.
    SwitchOn,
    /// Command: run.
    EnableOperation,
    /// The control runs.
    Ready,
    /// The quick stop has ended, the drive was stopped from elsewhere, or the bus has lost the right to start it.
    Stopped,
    /// A fault is latched, with the outputs off.
    Failed,
    /// The fault was cleared.
    Cleared,
}

impl Event {
    /// The command of a control word, by its bits 0 to 3.
    pub const fn of(control_word: u16) -> Self {
        match control_word & 0b1111 {
            0b1111 => EnableOperation,
            0b0111 => SwitchOn,
            0b0110 | 0b1110 => Shutdown,
            0b0010 | 0b0011 | 0b1010 | 0b1011 => QuickStop,
            _ => DisableVoltage,
        }
    }
}

/// A transition.
pub struct Transition {
    /// Its number in the standard.
    pub number: &'static str,
    /// The states from which it leads.
    pub from: &'static [Power],
    /// Its causes.
    pub on: &'static [Event],
    /// The state to which it leads.
    pub to: Power,
}

/// Rows of `NUMBER: [STATES] [CAUSES] STATE;`.
macro_rules! transitions {
    ($($number:literal: $from:tt $on:tt $to:ident;)+) => {
        [$(Transition { number: $number, from: &$from, on: &$on, to: Power::$to }),+]
    };
}

/// The transitions. The reaction to a fault ends within a control period, so 13 and 14 are one. From *ready to switch on*, *enable
/// operation* is followed by 3 and then 4.
pub static TRANSITIONS: [Transition; 15] = transitions! {
    "0, 1": [NotReadyToSwitchOn] [Ready] SwitchOnDisabled;
    "2": [SwitchOnDisabled] [Shutdown] ReadyToSwitchOn;
    "3": [ReadyToSwitchOn] [SwitchOn, EnableOperation] SwitchedOn;
    "4": [SwitchedOn] [EnableOperation] OperationEnabled;
    "5": [OperationEnabled] [SwitchOn] SwitchedOn;
    "6": [SwitchedOn] [Shutdown] ReadyToSwitchOn;
    "7": [ReadyToSwitchOn] [DisableVoltage, QuickStop, Stopped] SwitchOnDisabled;
    "8": [OperationEnabled] [Shutdown] ReadyToSwitchOn;
    "9": [OperationEnabled] [DisableVoltage, Stopped] SwitchOnDisabled;
    "10": [SwitchedOn] [DisableVoltage, QuickStop, Stopped] SwitchOnDisabled;
    "11": [OperationEnabled] [QuickStop] QuickStopActive;
    "12": [QuickStopActive] [DisableVoltage, Stopped] SwitchOnDisabled;
    "13, 14": [NotReadyToSwitchOn, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled, QuickStopActive] [Failed] Fault;
    "15": [Fault] [Cleared] SwitchOnDisabled;
    "16": [QuickStopActive] [EnableOperation] OperationEnabled;
};

/// The state after an event: that of the last transition that it causes, or the same state if it causes none.
pub fn after(mut state: Power, event: Event) -> Power {
    while let Some(next) =
        TRANSITIONS.iter().find(|t| t.from.contains(&state) && t.on.contains(&event))
    {
        state = next.to;
    }
    state
}
