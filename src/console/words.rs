//! The words of the kernel: why a request is refused, remarks on settings that were put in force, why saved settings are not used, and how
//! the last run ended.

use core::fmt::{self, Display, Formatter, Result};

use crate::boards::ALL_NAMES;
use crate::desk::handle::CommandError;
use crate::desk::order::{LOADER_DC_LINK_V, Refusal};
use crate::monitor::record::{Reason, Record};
use crate::settings::staging::{Applied, SetError};
use crate::store::FlashError;
use crate::store::codec::{Rejected, VERSION};

/// A hardware setting has changed.
pub const UNCONFIRMED: &str = "the board has to be confirmed again before a start";

/// Texts of a refusal, by the side that commands, in the order of [`Commander`](crate::settings::Commander).
const AUTHORITY: [&str; 3] = [
    "the console commands: `set bus.commands bus` lets the bus",
    "the bus commands: `stop` and `clear` work here, `set bus.commands console` takes over",
    "the terminal strip commands: `stop` works here, `set bus.commands console` takes over",
];

impl Display for Refusal {
    #[rustfmt::skip] // one refusal, one line
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Command(why) => why.fmt(f),
            Self::MustBeOff => f.write_str("the drive must be off: `stop` first"),
            Self::Authority(commander) => f.write_str(AUTHORITY[*commander as usize]),
            Self::Design(why) => write!(f, "{why}; not in force, still staged"),
            Self::Set(why) => why.fmt(f),
            Self::Flash(why) => why.fmt(f),
            Self::WrongBoard { theirs: Some(theirs), own } => write!(f, "these lines belong to the board {theirs}, this is {own}; `revert` drops them"),
            Self::WrongBoard { theirs: None, own } => write!(f, "these lines belong to none of the boards {ALL_NAMES}, this is {own}; `revert` drops them"),
            Self::LeftOut(lines) => write!(f, "lines of the backup that were refused: {lines}; `apply rest` puts the others in force, `revert` drops all"),
            Self::SavedOn { theirs, own } => write!(f, "this image is for the board {own}, the saved settings are of {theirs}: flash the image of {theirs}; only if this is a {own}: `defaults`, bench steps, `confirm board`"),
            Self::NotConfirmed => f.write_str("the board's polarities, dead time and scales are assumed, or were changed: do the bench steps that `board` lists, then `confirm board`"),
            Self::Staged => f.write_str("there are staged values: `apply` or `revert` first"),
            Self::NothingFound => f.write_str("nothing new was found: `commission` first"),
            Self::NothingLearned => f.write_str("nothing is learned with these settings: `learn` first"),
            Self::Homing(why) => why.fmt(f),
            Self::Unsaved => f.write_str("settings that were not saved would be lost: `save` first, or `reboot now`"),
            Self::Charged(volts) => write!(f, "the dc link has {volts:.0} V, and ST's loader drives a gate: {LOADER_DC_LINK_V} V at most"),
            Self::Hardware(key) => write!(f, "{} belongs to the hardware: set it at the console", key.name()),
            Self::Ended => f.write_str("a stop comes before a run: write 1 to 0x2000, or 6 to 0x6040"),
            Self::Held(why) => f.write_str(why),
            Self::Stopped => f.write_str("a stop came before the start"),
            Self::TooOften(s) => write!(f, "three faults of the power stage within 10 s: find the short circuit or the wrong wire; `clear` works in {s} s"),
            Self::Reference(why) => write!(f, "the reference is lost, {why}; close RESET or `clear`, then start anew"),
        }
    }
}

impl Display for CommandError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Refused(why) => why.fmt(f),
            Self::NoAnswer => f.write_str("the control does not run"),
            Self::NotStarted(why) => write!(f, "the control does not run: {why}"),
        }
    }
}

impl Display for SetError {
    #[rustfmt::skip] // one error, one line
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Board(key) => write!(f, "{} belongs to the board and is no setting of the console", key.name()),
            Self::Range(why) => why.fmt(f),
            Self::Loosens(key, guard) => write!(f, "{} would loosen {}, a protective setting: set it at the console", key.name(), guard.name()),
        }
    }
}

impl Display for Applied {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let notes = [
            (self.timer, "dead time and switching frequency change at the next reset, if saved"),
            (
                self.protection,
                "the limits hold in software; analog watchdogs and comparator follow from the next reset on, if saved",
            ),
            (self.unconfirmed, UNCONFIRMED),
        ];
        let mut separator = ": ";
        for (_, note) in notes.into_iter().filter(|(so, _)| *so) {
            write!(f, "{separator}{note}")?;
            separator = "; ";
        }
        if let Some(name) = self.forgotten {
            write!(f, "{separator}values learned with another {name} are dropped: learn again")?;
        }
        Ok(())
    }
}

impl Display for FlashError {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match self {
            Self::Erase(status) => write!(f, "the flash was not erased, status {status:#x}"),
            Self::Program(status) => write!(f, "the flash was not programmed, status {status:#x}"),
            Self::Verify(word) => write!(f, "double word {word} is read back differently"),
        }
    }
}

impl Display for Rejected {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        write!(f, "{} saved settings not used, defaults hold: ", self.code())?;
        match self {
            Self::Broken => f.write_str("no whole record"),
            Self::Newer(version) => write!(f, "version {version}, known is {VERSION}"),
            Self::Value(key) => write!(f, "unknown value of {key}"),
            Self::Refused => f.write_str("out of range"),
            Self::Board(name) => {
                write!(f, "saved on the board {name}; the gates are not connected")
            }
        }
    }
}

impl Display for Record {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let meaning = Reason::ALL.iter().find(|known| known.0 == self.reason);
        write!(f, "{} {}", self.reason as u8, meaning.map_or("", |known| known.1))?;
        self.details.iter().try_for_each(|word| write!(f, " {word:#x}"))
    }
}

/// Writes how the last run ended: the cause of the reset, the record of the run, and why the control was not started or the saved settings
/// are not used.
///
/// # Errors
/// Those of `to`.
pub fn last_run(
    to: &mut dyn fmt::Write,
    cause: &str,
    record: Option<&Record>,
    not_started: Option<&str>,
    rejected: Option<&Rejected>,
) -> Result {
    write!(to, "reset by {cause}")?;
    record.map_or(Ok(()), |record| write!(to, ", {record}"))?;
    not_started.map_or(Ok(()), |why| write!(to, "; not started: {why}"))?;
    rejected.map_or(Ok(()), |why| write!(to, "; {why}"))
}
