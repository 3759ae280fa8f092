//! A flash that loses power.

use crate::board::STORED_SLOTS;
use crate::store::*;

/// A flash that loses power; random bits decide what a power failure leaves.
#[derive(Clone, Debug)]
pub struct Fake {
    /// Contents; `None` is a torn double word.
    pub words: [[Option<u64>; SLOT_WORDS]; STORED_SLOTS],
    /// Operations until the power fails.
    pub left: Option<usize>,
    pub random: u64,
}

impl Fake {
    pub fn new() -> Self {
        Self { words: [[Some(u64::MAX); SLOT_WORDS]; STORED_SLOTS], left: None, random: 1 }
    }

    /// A record is in this slot.
    pub fn hold(&mut self, slot: usize, record: [u64; SLOT_WORDS]) {
        for (word, value) in record.into_iter().enumerate() {
            self.words[slot][word] = Some(value);
        }
    }

    /// Splitmix64.
    pub fn next(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.random ^ self.random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Whether the power fails in this operation.
    fn fails(&mut self) -> bool {
        match &mut self.left {
            None => false,
            Some(0) => true,
            Some(left) => {
                *left -= 1;
                false
            }
        }
    }

    /// The contents that a power failure leaves when `new` replaces `old`.
    fn left_of(&mut self, old: Option<u64>, new: u64) -> Option<u64> {
        match self.next() % 4 {
            0 => old,
            1 => Some(new),
            _ => None,
        }
    }
}

impl Flash for &mut Fake {
    fn read(&mut self, slot: usize, word: usize) -> Option<u64> {
        self.words[slot][word]
    }
    fn erase(&mut self, slot: usize) -> Result<(), FlashError> {
        let fails = self.fails();
        for word in 0..SLOT_WORDS {
            let old = self.words[slot][word];
            self.words[slot][word] =
                if fails { self.left_of(old, u64::MAX) } else { Some(u64::MAX) };
        }
        if fails { Err(FlashError::Erase(0)) } else { Ok(()) }
    }
    fn program(&mut self, slot: usize, word: usize, value: u64) -> Result<(), FlashError> {
        let old = self.words[slot][word];
        assert_eq!(old, Some(u64::MAX), "double word {word} is not erased");
        let fails = self.fails();
        self.words[slot][word] = if fails { self.left_of(old, value) } else { Some(value) };
        if fails { Err(FlashError::Program(0)) } else { Ok(()) }
    }
}
