//! Learned values as lines of text, which `backup` prints and a paste restores.
//!
//! `learned INDEX WORD ...` gives up to eight of the words of [`crate::store::learned`], from an index on, in hexadecimal; `learned check
//! WORD` gives the CRC-32 of Ethernet over all words, little-endian, and completes them.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use drive_core::learned::Learned;
use drive_settings::value::Words as _;
use thiserror::Error;

use super::grammar::WORDS_IN_LINE;
use crate::store::learned::{self, WORDS};

const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Words received so far.
pub struct Restore {
    words: [u32; WORDS],
    /// A bit for each word.
    present: u64,
}

/// Reason why learned values were not restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum RestoreError {
    /// More words than a result has.
    #[error("learned: more than {WORDS} words")]
    Behind,
    /// The word with this index has not come.
    #[error("learned: word {0} is missing")]
    Missing(usize),
    /// The checksum of the words differs.
    #[error("learned: the checksum of these words is {0:08x}")]
    Checksum(u32),
    /// The values were learned with another choice of the zero vectors: this word.
    #[error("learned: with scales.both_zero_vectors = {0}; set it to this first, or learn again")]
    ZeroVectors(&'static str),
    /// The values were learned by a firmware with other rules.
    #[error(
        "learned: by an earlier firmware, which measured the motor in another way; `commission`, then `learn`"
    )]
    Rules,
    /// The values are no result that a self-commissioning accepts.
    #[error("learned: no result that a learning accepts")]
    Unbelievable,
}

fn checksum(words: &[u32]) -> u32 {
    let mut digest = CRC.digest();
    words.iter().for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

impl Default for Restore {
    fn default() -> Self {
        Self { words: [0; WORDS], present: 0 }
    }
}

impl Restore {
    /// Takes words, from an index on.
    ///
    /// # Errors
    /// A result has fewer words; nothing is taken.
    pub fn take(&mut self, index: usize, words: &[u32]) -> Result<(), RestoreError> {
        let places = self.words.get_mut(index..index + words.len()).ok_or(RestoreError::Behind)?;
        places.copy_from_slice(words);
        self.present |= ((1 << words.len()) - 1) << index;
        Ok(())
    }

    /// The result of the words received so far, for currents of `both` zero vectors or of one. The next words begin a new result.
    ///
    /// # Errors
    /// Words are missing or damaged, form no result, or belong to other rules or zero vectors.
    pub fn finish(&mut self, check: u32, both: bool) -> Result<Learned, RestoreError> {
        let Self { words, present } = core::mem::take(self);
        if learned::is_of_other_rules(&words, present) {
            return Err(RestoreError::Rules);
        }
        if present != learned::ALL {
            return Err(RestoreError::Missing(present.trailing_ones() as usize));
        }
        let right = checksum(&words);
        if right != check {
            return Err(RestoreError::Checksum(right));
        }
        if learned::in_both(&words) != both {
            return Err(RestoreError::ZeroVectors((!both).word()));
        }
        learned::from_words(&words).ok_or(RestoreError::Unbelievable)
    }
}

/// Line number `i` of a result; `None` after the last.
pub fn line(result: &Learned, both: bool, i: usize) -> Option<impl fmt::Display> {
    let words = learned::to_words(result, both);
    let first = i * WORDS_IN_LINE;
    (first < WORDS + WORDS_IN_LINE).then_some(fmt::from_fn(move |f| match words.get(first..) {
        Some(rest) if !rest.is_empty() => {
            write!(f, "learned {first}")?;
            rest.iter().take(WORDS_IN_LINE).try_for_each(|word| write!(f, " {word:08x}"))
        }
        _ => write!(f, "learned check {:08x}", checksum(&words)),
    }))
}
