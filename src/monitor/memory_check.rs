//! Has a bit of the control's memory flipped? Looked at in slices, one a pass of the main loop.
//!
//! What the control interrupt executes is compared with the flash it was copied from, which corrects
//! itself. What it only reads, the coefficients of the drive above all, has no second copy: its hash must
//! stay the same for as long as the drive counts no change of its coefficients. The first whole look
//! after a change is what the later ones are compared with: a flip in the milliseconds between is taken
//! for a part of the change.
//!
//! What the interrupt writes in every period cannot be judged in this way; the drive's own checks do.

/// Words of code compared in a pass of the main loop.
const CODE_SLICE: u32 = 64;
/// Words of constants hashed in one.
const CONSTANTS_SLICE: u32 = 16;

/// A stretch of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Where it begins; a multiple of 4.
    pub address: u32,
    /// How long it is.
    pub words: u32,
}

/// Where everything is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Places<const N: usize> {
    /// The code that is executed.
    pub code: Part,
    /// Where it was copied from.
    pub source: u32,
    /// What stays as it is until `changes` counts.
    pub constants: [Part; N],
    /// The count of changes.
    pub changes: u32,
}

/// What has flipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flipped {
    /// A word of the code: its address, what it holds, and what it should.
    Code {
        /// Address.
        address: u32,
        /// What it holds.
        found: u32,
        /// What the flash holds.
        copied: u32,
    },
    /// Something among the constants: their hash now, and before.
    Constants {
        /// Hash now.
        found: u32,
        /// Hash before.
        before: u32,
    },
}

/// The check, and how far it has come.
#[derive(Clone, Debug)]
pub struct MemoryCheck<const N: usize> {
    places: Places<N>,
    /// Next word of the code.
    code: u32,
    /// Next part of the constants, and word in it.
    part: usize,
    word: u32,
    hash: u32,
    /// Count of changes as this look began.
    changes: u32,
    /// Hash of the last whole look, and the count of changes then.
    sealed: Option<(u32, u32)>,
}

impl<const N: usize> MemoryCheck<N> {
    /// From now on; `read` gives the word at an address.
    pub fn new(places: Places<N>, read: impl Fn(u32) -> u32) -> Self {
        let changes = read(places.changes);
        Self { places, code: 0, part: 0, word: 0, hash: FNV_BASIS, changes, sealed: None }
    }

    /// Looks at the next slices.
    ///
    /// # Errors
    /// What has flipped.
    pub fn slice(&mut self, read: impl Fn(u32) -> u32) -> Result<(), Flipped> {
        self.compare_code(&read)?;
        self.hash_constants(&read)
    }

    fn compare_code(&mut self, read: &impl Fn(u32) -> u32) -> Result<(), Flipped> {
        let Places { code, source, .. } = self.places;
        let end = (self.code + CODE_SLICE).min(code.words);
        for word in self.code..end {
            let (address, copied) = (code.address + 4 * word, read(source + 4 * word));
            let found = read(address);
            if found != copied {
                return Err(Flipped::Code { address, found, copied });
            }
        }
        self.code = if end == code.words { 0 } else { end };
        Ok(())
    }

    fn hash_constants(&mut self, read: &impl Fn(u32) -> u32) -> Result<(), Flipped> {
        let mut left = CONSTANTS_SLICE;
        while let Some(part) = self.places.constants.get(self.part) {
            let end = (self.word + left).min(part.words);
            for word in self.word..end {
                self.hash = hashed(self.hash, read(part.address + 4 * word));
            }
            left -= end - self.word;
            self.word = end;
            if end < part.words {
                return Ok(());
            }
            (self.part, self.word) = (self.part + 1, 0);
        }
        // All were looked at.
        let changes = read(self.places.changes);
        let found = core::mem::replace(&mut self.hash, FNV_BASIS);
        self.part = 0;
        if core::mem::replace(&mut self.changes, changes) != changes {
            return Ok(()); // changed meanwhile: the next look is the first
        }
        match self.sealed {
            Some((before, then)) if then == changes && before != found => {
                Err(Flipped::Constants { found, before })
            }
            _ => {
                self.sealed = Some((found, changes));
                Ok(())
            }
        }
    }
}

const FNV_BASIS: u32 = 0x811c_9dc5;

/// FNV-1a, a word at a time. Each step is one-to-one in the hash and in the word: a change of one word
/// always shows.
fn hashed(hash: u32, word: u32) -> u32 {
    (hash ^ word).wrapping_mul(0x0100_0193)
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use proptest::prelude::*;

    use super::*;

    const CODE: Part = Part { address: 0, words: 1000 };
    const SOURCE: u32 = 4 * 1000;
    const CONSTANTS: [Part; 3] = [
        Part { address: 8000, words: 300 },
        Part { address: 9500, words: 1 },
        Part { address: 9600, words: 17 },
    ];
    const CHANGES: u32 = 9996;
    /// Passes in which everything is looked at: 1000 words of code, 318 of constants.
    const WHOLE: u32 = 20;

    struct Memory(RefCell<Vec<u32>>);

    impl Memory {
        /// Any contents, the code a copy.
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
        let places = Places { code: CODE, source: SOURCE, constants: CONSTANTS, changes: CHANGES };
        MemoryCheck::new(places, |at| memory.read(at))
    }

    fn run(check: &mut MemoryCheck<3>, memory: &Memory, passes: u32) -> Result<(), Flipped> {
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
                prop_assert_eq!(found, Err(Flipped::Code { address, found: found_word, copied }));
            } else {
                prop_assert!(matches!(found, Err(Flipped::Constants { .. })), "{:?}", found);
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
            // What was taken over then is watched as well.
            memory.flip(8000 + 4 * word, 4);
            prop_assert!(run(&mut check, &memory, 2 * WHOLE).is_err());
        }
    }
}
