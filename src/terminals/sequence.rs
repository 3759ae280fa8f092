//! Starts and stops by START, if the terminals command.

use crate::terminals::settings::Start;

/// Number of readings, one per millisecond, for which the contact at START must have been open without a break, with the drive allowed to
/// run, before its closing counts. So neither a switch that is closed at power-up nor one that bounces starts the drive.
pub const ARMED: u8 = 100;

/// Inputs of the sequence beside START.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The terminals command.
    pub commands: bool,
    /// ENABLE or STOP keeps the drive from running.
    pub held: bool,
    /// Controllers are being designed: an accepted start has not begun.
    pub busy: bool,
    /// The drive is off, with or without a fault, or stopping: a start begins, or turns the stop round.
    pub ended: bool,
}

/// Action of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Nothing.
    Nothing,
    /// Start.
    Start,
    /// Give the speed: the drive runs for the terminals.
    Go,
    /// Stop.
    Stop,
}

/// Follows START. A run that has ended for any reason needs a new edge.
#[derive(Debug, Default)]
pub struct Sequence {
    /// Consecutive readings at which the contact was open with the drive allowed to run, up to [`ARMED`]. There it stays until START is
    /// closed.
    open: u8,
    /// Whether the drive runs for the terminals.
    runs: bool,
}

impl Sequence {
    /// Takes another reading: `contact` is the contact at START, `closed` its debounced state.
    pub fn step(&mut self, start: Start, contact: bool, closed: bool, seen: Seen) -> Act {
        let Seen { commands, held, busy, ended } = seen;
        let may = commands && !held && start != Start::Off;
        let edge = may && closed && self.open == ARMED;
        self.open = match self.open {
            _ if !may || closed => 0,
            ARMED => ARMED,
            _ if contact => 0,
            open => open + 1,
        };
        self.runs &= commands && (busy || !ended);
        if edge && ended && !busy {
            self.runs = true;
            return Act::Start;
        }
        match self.runs && !busy {
            false => Act::Nothing,
            true if start == Start::Switch && !closed => Act::Stop,
            true => Act::Go,
        }
    }
}
