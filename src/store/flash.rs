//! The flash for settings and history, and its errors.

use thiserror::Error;

use crate::board;

/// Number of slots, each of which holds one set of settings.
pub const SLOTS: usize = 2;
/// Double words in a slot.
pub const SLOT_WORDS: usize = board::SETTINGS_SLOT_BYTES as usize / 8;

/// A flash of [`board::STORED_SLOTS`] slots of [`SLOT_WORDS`] double words.
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

    /// Programs an erased double word and reads it back.
    ///
    /// # Errors
    /// The flash reports an error, exceeds its time, or holds another value.
    fn write(&mut self, slot: usize, word: usize, value: u64) -> Result<(), FlashError> {
        self.program(slot, word, value)?;
        let same = self.read(slot, word) == Some(value);
        same.then_some(()).ok_or(FlashError::Verify(word))
    }
}

/// Contents of an erased double word.
pub const ERASED: u64 = u64::MAX;

/// A double word of these two halves.
pub const fn pair(low: u32, high: u32) -> u64 {
    low as u64 | (high as u64) << 32
}

/// The two halves of a double word, the lower first.
pub const fn halves(word: u64) -> (u32, u32) {
    (word as u32, (word >> 32) as u32)
}

/// The valid one of two slots that are written in turn, and its sequence number. The argument has the sequence numbers of the whole
/// slots; they are adjacent, and wrap.
pub fn newer(sequences: [Option<u32>; 2]) -> Option<(usize, u32)> {
    match sequences {
        [Some(a), Some(b)] if (b.wrapping_sub(a) as i32) < 0 => Some((0, a)),
        [_, Some(b)] => Some((1, b)),
        [a, None] => Some((0, a?)),
    }
}

/// A failed operation of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum FlashError {
    /// An erasure failed, with this status register.
    Erase(u32),
    /// Programming failed, with this status register.
    Program(u32),
    /// This double word reads back differently than programmed.
    Verify(usize),
}
