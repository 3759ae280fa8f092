//! Starts and stops by START, for a strip that commands.

use crate::settings::strip::Start;

/// Looks, a millisecond each, for which START must have been open, with the drive allowed to run, before its closing counts: neither
/// a switch that is closed as the power comes nor one that bounces starts the drive.
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
    /// Looks in a row at which START was open with the drive allowed to run, up to [`ARMED`].
    open: u8,
    /// Whether the drive runs for the strip.
    runs: bool,
}

impl Sequence {
    /// Another look: `closed` is START.
    pub fn step(&mut self, start: Start, closed: bool, seen: Seen) -> Act {
        let Seen { commands, held, busy, off, ended } = seen;
        let may = commands && !held && start != Start::Off;
        let edge = may && closed && self.open == ARMED;
        self.open = if may && !closed { (self.open + 1).min(ARMED) } else { 0 };
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
