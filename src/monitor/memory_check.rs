//! Check of the control's memory for flipped bits, a slice in each pass of the main loop.
//!
//! The code of the control interrupt is compared with its source in the flash, which corrects errors. The data that the interrupt only
//! reads, mainly the coefficients of the drive, have no second copy: their hash must stay the same as long as the drive counts no change
//! of its coefficients. The first whole pass after a change is the reference of the later ones, so a flip in the milliseconds between is
//! taken for a part of the change.
//!
//! Data that the interrupt writes in every period cannot be checked in this way; the drive's own checks cover them.

use super::record::{Reason, Record};
use crate::hash;

/// Words of code compared in a pass of the main loop.
const CODE_SLICE: u32 = 64;
/// Words of constants hashed in a pass.
const CONSTANTS_SLICE: u32 = 16;

/// A range of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryRange {
    /// First address; a multiple of 4.
    pub address: u32,
    /// Length in words.
    pub words: u32,
}

/// The memory to check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckedMemory<const N: usize> {
    /// The executed code.
    pub code: MemoryRange,
    /// Address that the code was copied from.
    pub source: u32,
    /// Data that change only when the count at `changes` does.
    pub constants: [MemoryRange; N],
    /// Address of the count of changes.
    pub changes: u32,
}

/// The check and its progress.
#[derive(Clone, Debug)]
pub struct MemoryCheck<const N: usize> {
    memory: CheckedMemory<N>,
    /// Next word of the code to compare.
    code: u32,
    /// Next range of the constants, and next word in it.
    range: usize,
    word: u32,
    hash: u32,
    /// Count of changes at the start of this pass.
    changes: u32,
    /// Hash of the last whole pass, and the count of changes then.
    sealed: Option<(u32, u32)>,
}

impl<const N: usize> MemoryCheck<N> {
    /// A check that begins now; `read` reads the word at an address.
    pub fn new(memory: CheckedMemory<N>, read: impl Fn(u32) -> u32) -> Self {
        let changes = read(memory.changes);
        Self { memory, code: 0, range: 0, word: 0, hash: hash::BASIS, changes, sealed: None }
    }

    /// Checks the next slices.
    ///
    /// # Errors
    /// A flipped bit in the code or in the constants, as the record of the run that it ends.
    pub fn slice(&mut self, read: impl Fn(u32) -> u32) -> Result<(), Record> {
        self.compare_code(&read)?;
        self.hash_constants(&read)
    }

    fn compare_code(&mut self, read: &impl Fn(u32) -> u32) -> Result<(), Record> {
        let CheckedMemory { code, source, .. } = self.memory;
        let end = (self.code + CODE_SLICE).min(code.words);
        for word in self.code..end {
            let (address, copied) = (code.address + 4 * word, read(source + 4 * word));
            let found = read(address);
            if found != copied {
                return Err(Record { reason: Reason::Code, details: [address, found, copied, 0] });
            }
        }
        self.code = if end == code.words { 0 } else { end };
        Ok(())
    }

    fn hash_constants(&mut self, read: &impl Fn(u32) -> u32) -> Result<(), Record> {
        let mut left = CONSTANTS_SLICE;
        while let Some(range) = self.memory.constants.get(self.range) {
            let end = (self.word + left).min(range.words);
            for word in self.word..end {
                self.hash = hash::add(self.hash, read(range.address + 4 * word));
            }
            left -= end - self.word;
            self.word = end;
            if end < range.words {
                return Ok(());
            }
            (self.range, self.word) = (self.range + 1, 0);
        }
        let changes = read(self.memory.changes);
        let found = core::mem::replace(&mut self.hash, hash::BASIS);
        self.range = 0;
        if core::mem::replace(&mut self.changes, changes) != changes {
            return Ok(()); // changed meanwhile: the next pass is the first
        }
        match self.sealed {
            Some((before, then)) if then == changes && before != found => {
                Err(Record { reason: Reason::Coefficients, details: [found, before, 0, 0] })
            }
            _ => {
                self.sealed = Some((found, changes));
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use proptest::prelude::*;

    use super::*;

    const CODE: MemoryRange = MemoryRange { address: 0, words: 1000 };
    const SOURCE: u32 = 4 * 1000;
    const CONSTANTS: [MemoryRange; 3] = [
        MemoryRange { address: 8000, words: 300 },
        MemoryRange { address: 9500, words: 1 },
        MemoryRange { address: 9600, words: 17 },
    ];
    const CHANGES: u32 = 9996;
    /// Number of passes that cover everything: 1000 words of code, 318 of constants.
    const WHOLE: u32 = 20;

    struct Memory(RefCell<Vec<u32>>);

    impl Memory {
        /// A memory with arbitrary contents; the code is a copy.
        fn new() -> Self {
            let mut words: Vec<u32> =
                (0..2500_u32).map(|n| n.wrapping_mul(2_654_435_769)).collect();
            words.copy_within(1000..2000, 0);
            Self(RefCell::new(words))
        }

        fn read(&self, address: u32) -> u32 {
            self.0.borrow()[address as usize / 4]
        }

        fn flip(&self, address: u32, bit: u32) {
            self.0.borrow_mut()[address as usize / 4] ^= 1 << bit;
        }
    }

    fn check(memory: &Memory) -> MemoryCheck<3> {
        let memory_map =
            CheckedMemory { code: CODE, source: SOURCE, constants: CONSTANTS, changes: CHANGES };
        MemoryCheck::new(memory_map, |at| memory.read(at))
    }

    fn run(check: &mut MemoryCheck<3>, memory: &Memory, passes: u32) -> Result<(), Record> {
        (0..passes).try_for_each(|_| check.slice(|at| memory.read(at)))
    }

    proptest! {
        #[test]
        fn a_flip_anywhere_is_found_in_two_whole_looks(
            passes in WHOLE..3 * WHOLE, word in 0_u32..1318, bit in 0_u32..32
        ) {
            let memory = Memory::new();
            let mut check = check(&memory);
            prop_assert_eq!(run(&mut check, &memory, passes), Ok(()));
            let address = match word {
                0..1000 => 4 * word,
                1000..1300 => 8000 + 4 * (word - 1000),
                1300 => 9500,
                _ => 9600 + 4 * (word - 1301),
            };
            memory.flip(address, bit);
            let found = run(&mut check, &memory, 2 * WHOLE);
            if word < 1000 {
                let copied = memory.read(SOURCE + address);
                let found_word = memory.read(address);
                let details = [address, found_word, copied, 0];
                prop_assert_eq!(found, Err(Record { reason: Reason::Code, details }));
            } else {
                prop_assert_eq!(found.map_err(|end| end.reason), Err(Reason::Coefficients));
            }
        }

        #[test]
        fn a_change_that_is_counted_is_none(before in 0..3 * WHOLE, word in 0_u32..300) {
            let memory = Memory::new();
            let mut check = check(&memory);
            prop_assert_eq!(run(&mut check, &memory, before), Ok(()));
            memory.flip(8000 + 4 * word, 3);
            memory.flip(CHANGES, 0);
            prop_assert_eq!(run(&mut check, &memory, 4 * WHOLE), Ok(()));
            // The data that the check took over then are watched as well.
            memory.flip(8000 + 4 * word, 4);
            prop_assert!(run(&mut check, &memory, 2 * WHOLE).is_err());
        }
    }
}
