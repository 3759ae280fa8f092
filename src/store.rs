//! Settings that outlast a reset: two places in the flash, written in turn.
//!
//! One holds the set that counts, the other is written by the next `save`: erased, then the record,
//! the double word with sequence number and checksum last. Wherever the power fails, that double word
//! is missing, torn or whole, so that the set before counts, or the new one; there is no instant with
//! none. A double word torn by a power failure is read as an error of the flash, never as data.
//!
//! (Not `sequential-storage`, which moves what it holds through one page that it erases: it tells a page
//! in use by 4 bits of its first and last word. With a page half erased it takes what is left of it for
//! the source, and erases the good copy.)

pub mod codec;
pub mod learned;

use core::fmt;

use crate::board;
use crate::console::keys::FirmwareSettings;
use codec::{COMMIT, Found, WORDS};

/// How many places there are.
pub const SLOTS: usize = 2;
/// Double words in one.
pub const SLOT_WORDS: usize = board::SETTINGS_SLOT_BYTES as usize / 8;
const _: () = assert!(WORDS <= SLOT_WORDS);

/// The flash behind the settings, in slots of [`SLOT_WORDS`] double words.
pub trait Flash {
    /// A double word, or nothing if the flash cannot correct it.
    fn read(&mut self, slot: usize, word: usize) -> Option<u64>;
    /// Erases a slot: all bits set.
    ///
    /// # Errors
    /// The flash says so, or takes too long.
    fn erase(&mut self, slot: usize) -> Result<(), Failed>;
    /// Programs a double word that is erased.
    ///
    /// # Errors
    /// The flash says so, or takes too long.
    fn program(&mut self, slot: usize, word: usize, value: u64) -> Result<(), Failed>;
}

/// The flash did not do what it was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failed {
    /// An erasure, with the status register.
    Erase(u32),
    /// A programming, with the status register.
    Program(u32),
    /// What was programmed is read back differently: at this double word.
    Verify(usize),
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Erase(status) => write!(f, "the flash was not erased, status {status:#x}"),
            Self::Program(status) => write!(f, "the flash was not programmed, status {status:#x}"),
            Self::Verify(word) => write!(f, "double word {word} is read back differently"),
        }
    }
}

/// Why what is in the flash is not used; numbered like the faults (see `record.rs`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotUsed {
    /// There is something, but no whole record.
    Broken,
    /// Written by a later version of the firmware: the version of its record.
    Newer(u16),
    /// The value of this setting is none that the firmware knows.
    Value(&'static str),
    /// The design rules do not take the settings.
    Refused,
}

impl NotUsed {
    /// Its number.
    pub const fn code(self) -> u8 {
        match self {
            Self::Broken => 70,
            Self::Newer(_) => 71,
            Self::Value(_) => 72,
            Self::Refused => 73,
        }
    }
}

impl fmt::Display for NotUsed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} saved settings not used, defaults hold: ", self.code())?;
        match self {
            Self::Broken => f.write_str("no whole record"),
            Self::Newer(version) => write!(f, "version {version}, known is {}", codec::VERSION),
            Self::Value(key) => write!(f, "unknown value of {key}"),
            Self::Refused => f.write_str("out of range"),
        }
    }
}

/// What was found at start.
#[derive(Clone, Copy, Debug, PartialEq)]
// There is one at a time.
#[allow(clippy::large_enum_variant)]
pub enum Loaded {
    /// Nothing was ever saved.
    Nothing,
    /// The settings.
    Settings(FirmwareSettings),
    /// Something that is left as it is until the next `save`.
    NotUsed(NotUsed),
}

/// The flash, and which slot the next `save` must not touch.
#[derive(Debug)]
pub struct Saved<F> {
    flash: F,
    /// The slot that counts, and its sequence number.
    newest: Option<(usize, u32)>,
    /// Where the next one goes if none counts.
    free: usize,
}

impl<F: Flash> Saved<F> {
    /// Looks at both slots. Settings that were saved before a key existed leave it as in `defaults`.
    pub fn load(mut flash: F, defaults: &FirmwareSettings) -> (Self, Loaded) {
        let found = [0, 1].map(|slot| codec::find(&mut |word| flash.read(slot, word)));
        let sequence = |slot: usize| match found.get(slot) {
            Some(Found::Whole { sequence, .. }) => Some(*sequence),
            _ => None,
        };
        let newest = match (sequence(0), sequence(1)) {
            // Numbers wrap; the two are next to each other.
            (Some(a), Some(b)) if (b.wrapping_sub(a) as i32) < 0 => Some((0, a)),
            (_, Some(b)) => Some((1, b)),
            (Some(a), None) => Some((0, a)),
            (None, None) => None,
        };
        let loaded = match newest {
            Some((slot, _)) => codec::settings(&mut |word| flash.read(slot, word), defaults)
                .map_or_else(Loaded::NotUsed, Loaded::Settings),
            None if found == [Found::Blank; SLOTS] => Loaded::Nothing,
            None => Loaded::NotUsed(NotUsed::Broken),
        };
        let free = usize::from(found[0] != Found::Blank && found[1] == Found::Blank);
        (Self { flash, newest, free }, loaded)
    }

    /// Writes the settings. Takes long; only with the outputs off.
    ///
    /// # Errors
    /// Why not; the set before still counts then.
    pub fn save(&mut self, settings: &FirmwareSettings) -> Result<(), Failed> {
        let (slot, sequence) = match self.newest {
            Some((newest, sequence)) => (1 - newest, sequence.wrapping_add(1)),
            None => (self.free, 0),
        };
        let record = codec::record(settings, sequence);
        self.flash.erase(slot)?;
        // The one that makes it whole comes last.
        let others = (0..codec::length(&record)).filter(|word| *word != COMMIT);
        for word in others.chain([COMMIT]) {
            let Some(value) = record.get(word) else { continue };
            self.flash.program(slot, word, *value)?;
            if self.flash.read(slot, word) != Some(*value) {
                return Err(Failed::Verify(word));
            }
        }
        self.newest = Some((slot, sequence));
        Ok(())
    }
}

#[cfg(test)]
mod tests;
