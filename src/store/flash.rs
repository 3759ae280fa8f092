//! The flash behind the settings, and its errors.

use core::fmt;

use crate::board;

/// Number of slots, each of which holds one set of settings.
pub const SLOTS: usize = 2;
/// Double words in a slot.
pub const SLOT_WORDS: usize = board::SETTINGS_SLOT_BYTES as usize / 8;

/// A flash of [`SLOTS`] slots of [`SLOT_WORDS`] double words.
pub trait Flash {
    /// Reads a double word; `None` if the flash cannot correct it.
    fn read(&mut self, slot: usize, word: usize) -> Option<u64>;
    /// Erases a slot: all bits set.
    ///
    /// # Errors
    /// The flash reports an error or exceeds its time.
    fn erase(&mut self, slot: usize) -> Result<(), FlashError>;
    /// Programs an erased double word.
    ///
    /// # Errors
    /// The flash reports an error or exceeds its time.
    fn program(&mut self, slot: usize, word: usize, value: u64) -> Result<(), FlashError>;
}

/// A failed operation of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// An erasure failed, with this status register.
    Erase(u32),
    /// Programming failed, with this status register.
    Program(u32),
    /// This double word reads back differently than programmed.
    Verify(usize),
}

impl fmt::Display for FlashError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Erase(status) => write!(f, "the flash was not erased, status {status:#x}"),
            Self::Program(status) => write!(f, "the flash was not programmed, status {status:#x}"),
            Self::Verify(word) => write!(f, "double word {word} is read back differently"),
        }
    }
}
