//! The reason why the last run ended, as words that survive a reset in RAM that is not cleared.

use crate::hash;

/// Reasons to stop. The numbers continue those of the drive's faults; 70 to 73 and 76 belong to rejected settings (see `store/codec.rs`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// An error in the firmware; details: the line.
    Panic = 64,
    /// A fault of the processor; details: program counter, link register, CFSR, BFAR.
    HardFault = 65,
    /// A non-maskable interrupt; details: RCC_CIFR, FLASH_ECCR.
    NonMaskable = 66,
    /// An interrupt without a handler; details: its number.
    Unexpected = 67,
    /// The watchdog was not fed; details: control periods, cycles, whether a deadline was missed.
    NotFed = 68,
    /// The drive's own fault; details: its number.
    Drive = 69,
    /// A bit of the control's code has flipped; details: address, its contents, those of the flash.
    Code = 74,
    /// A bit of the coefficients has flipped; details: their hash now, and before.
    Coefficients = 75,
    /// A configuration register has changed; details: address, its checked bits, and those that have changed, its upper half on its
    /// lower.
    Register = 77,
    /// A bit of the drive's state has flipped: its phase word is invalid, or it wants its outputs on although no start was taken;
    /// details: the word of the phase.
    State = 78,
}

impl Reason {
    /// All reasons, each with a short text.
    pub const ALL: [(Self, &str); 10] = [
        (Self::Panic, "panic"),
        (Self::HardFault, "processor fault"),
        (Self::NonMaskable, "clock or flash failure"),
        (Self::Unexpected, "unexpected interrupt"),
        (Self::NotFed, "watchdog not fed"),
        (Self::Drive, "fault of the drive"),
        (Self::Code, "code of the control changed"),
        (Self::Coefficients, "coefficients of the control changed"),
        (Self::Register, "register of the chip changed"),
        (Self::State, "state of the control changed"),
    ];
}

/// The record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// The reason.
    pub reason: Reason,
    /// See [`Reason`].
    pub details: [u32; 4],
}

/// Words of a record in memory.
pub const WORDS: usize = 7;

/// Distinguishes a record from the contents of RAM after power-on.
const MAGIC: u32 = 0x7265_6331;

impl Record {
    /// The words of the record.
    pub fn to_words(self) -> [u32; WORDS] {
        let [a, b, c, d] = self.details;
        let reason = self.reason as u32;
        let check = check(&[MAGIC, reason, a, b, c, d]);
        [MAGIC, reason, a, b, c, d, check]
    }

    /// The record of these words, if it is whole.
    pub fn from_words(words: &[u32; WORDS]) -> Option<Self> {
        let [magic, reason, a, b, c, d, checked] = *words;
        if magic != MAGIC || checked != check(&[magic, reason, a, b, c, d]) {
            return None;
        }
        let (reason, _) = Reason::ALL.into_iter().find(|known| known.0 as u32 == reason)?;
        Some(Self { reason, details: [a, b, c, d] })
    }
}

/// The hash of the words, which detects a record that a reset interrupted.
fn check(words: &[u32]) -> u32 {
    hash::of(words.iter().flat_map(|word| word.to_le_bytes()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_follow_those_of_the_drive_and_never_change() {
        let codes: Vec<u8> = Reason::ALL.iter().map(|reason| reason.0 as u8).collect();
        assert_eq!(codes, [64, 65, 66, 67, 68, 69, 74, 75, 77, 78]);
        assert!(drive_core::Fault::ALL.iter().all(|fault| fault.code() < 64));
    }

    proptest! {
        #[test]
        fn a_record_is_read_back(i in 0..Reason::ALL.len(), details: [u32; 4]) {
            let record = Record { reason: Reason::ALL[i].0, details };
            prop_assert_eq!(Record::from_words(&record.to_words()), Some(record));
        }

        #[test]
        fn a_flipped_bit_is_found(i in 0..Reason::ALL.len(), details: [u32; 4],
                                  word in 0..WORDS, bit in 0_u32..32) {
            let mut words = Record { reason: Reason::ALL[i].0, details }.to_words();
            words[word] ^= 1 << bit;
            prop_assert_eq!(Record::from_words(&words), None);
        }

        #[test]
        fn what_ram_holds_after_power_on_is_no_record(words: [u32; WORDS]) {
            prop_assert_eq!(Record::from_words(&words), None);
        }
    }
}
