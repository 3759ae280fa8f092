//! Starts and stops by START, for a strip that commands.

use crate::settings::strip::Start;

/// Looks, a millisecond each, for which the contact at START must have been open without a break, with the drive allowed to run, before
/// its closing counts: neither a switch that is closed as the power comes nor one that bounces starts the drive.
pub const ARMED: u8 = 100;

/// What the sequence sees beside START.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// The strip commands.
    pub commands: bool,
    /// ENABLE or STOP keeps the drive from running.
    pub held: bool,
    /// Controllers are being designed: a start that was taken has not begun.
    pub busy: bool,
    /// The drive is off, with a fault or without.
    pub off: bool,
    /// It is off or stopping.
    pub ended: bool,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Nothing.
    Nothing,
    /// Start.
    Start,
    /// Give the speed: the drive runs for the strip.
    Go,
    /// Stop.
    Stop,
}

/// Follows START. A run that has ended for any reason needs a new edge.
#[derive(Debug, Default)]
pub struct Sequence {
    /// Looks in a row at which the contact was open with the drive allowed to run, up to [`ARMED`], where it stays until START is closed.
    open: u8,
    /// Whether the drive runs for the strip.
    runs: bool,
}

impl Sequence {
    /// Another look: `contact` is that at START, `closed` what the debounce makes of it.
    pub fn step(&mut self, start: Start, contact: bool, closed: bool, seen: Seen) -> Act {
        let Seen { commands, held, busy, off, ended } = seen;
        let may = commands && !held && start != Start::Off;
        let edge = may && closed && self.open == ARMED;
        self.open = match self.open {
            _ if !may || closed => 0,
            ARMED => ARMED,
            _ if contact => 0,
            open => open + 1,
        };
        self.runs &= commands && (busy || !ended);
        if edge && off && !busy {
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
