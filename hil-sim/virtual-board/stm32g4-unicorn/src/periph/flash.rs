//! The flash (RM0440, section 3): two banks, programmed by double words, erased by pages of 2 KiB.
//!
//! Only the part behind the code ([`STORED`]) can be written. A double word that was being written when power failed
//! has a wrong check code: reading it raises the NMI. A page whose erasure was cut short contains such words too. So
//! does, until a reset, the double word of the code that a test damages.
//!
//! A fetch or a read from a bank that is being written waits for the end of the operation.

use std::ops::Range;

use super::{Effect, Store, bits, offsets};
use crate::memory::{BANK_2, FLASH, FLASH_END, FLASH_SIZE, STORED};
use crate::rules::{Rule, Rules};

offsets! { ACR = 0x00, KEYR = 0x08, SR = 0x10, CR = 0x14, ECCR = 0x18, OPTR = 0x20 }

// ACR, CR, SR, ECCR.
bits! { DCEN = 10 }
bits! { PG = 0, PER = 1, BKER = 11, STRT = 16, LOCK = 31 }
bits! { EOP = 0, PROGERR = 3, SIZERR = 6, PGSERR = 7, BSY = 16 }
bits! { ECCC = 30, ECCD = 31 }
/// Option: two banks of pages of 2 KiB, or one bank of pages of 4 KiB.
pub const DBANK: u32 = 1 << 22;
/// Option bytes from the factory.
const OPTIONS: u32 = 0xffef_f8aa;
/// Supply, V, below which the chip is held in reset, by BOR_LEV (datasheet, typical, falling).
const BROWN_OUT: [f64; 8] = [1.66, 2.0, 2.26, 2.57, 2.83, 2.83, 2.83, 2.83];
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Size of the writable part, bytes.
const SIZE: usize = (FLASH_END - STORED) as usize;
/// Bytes of a page.
pub const PAGE: usize = 2048;
/// Typical time, ticks, of programming a double word: 82 us (datasheet).
pub const PROGRAM: u64 = 82 * 170;
/// Typical time, ticks, of erasing a page: 22 ms (datasheet).
pub const ERASE: u64 = 22_000 * 170;

defaults! {
    /// The flash; by default erased.
    #[derive(Clone, Debug)]
    pub struct Flash {
        store: Store = Store::of("FLASH"),
        /// Option bytes, as FLASH_OPTR shows them.
        pub options: u32 = OPTIONS,
        status: u32,
        eccr: u32,
        keys: usize,
        /// End of the last operation.
        pub busy_until: u64,
        /// Lower half of a double word that is being programmed.
        half: Option<(u32, u32)>,
        pub(crate) bytes: Vec<u8> = vec![0xff; SIZE],
        /// Double words whose check code is wrong.
        pub(crate) torn: Vec<bool> = vec![false; SIZE / 8],
        /// Address of a double word of the code whose check code is wrong.
        pub bad_code: Option<u32>,
        /// Addresses in the code whose check code the boot loader has left wrong, because power failed.
        pub(crate) torn_code: Range<u32> = 0..0,
        /// Double words of the last operation.
        changing: Range<usize> = 0..0,
        /// Number of operations since the beginning: double words programmed, pages erased.
        pub operations: u64,
        /// The operation, counted from 1, in which power fails; its double word or page is torn.
        pub power_loss_at: Option<u64>,
        /// Whether power has failed.
        pub power_lost: bool,
    }
}

impl Flash {
    /// Returns the number of wait states.
    pub fn wait_states(&self) -> u32 {
        self.store.get(ACR) & 15
    }

    /// Returns the supply, V, below which the chip is held in reset.
    pub fn brown_out_v(&self) -> f64 {
        BROWN_OUT[(self.options >> 8 & 7) as usize]
    }

    /// Notes an error that the check code has corrected.
    pub fn correct(&mut self) {
        self.eccr |= ECCC;
    }

    /// Gives a double word of the stored part a wrong check code.
    pub fn tear(&mut self, address: u32) {
        if let Some(torn) = self.torn.get_mut(((address - STORED) / 8) as usize) {
            *torn = true;
        }
    }

    /// Returns the contents of the stored part, and its double words whose check code is wrong.
    pub fn contents(&self) -> (&[u8], &[bool]) {
        (&self.bytes, &self.torn)
    }

    /// Replaces the contents with those of another flash of this size.
    pub fn replace_contents(&mut self, bytes: &[u8], torn: &[bool]) {
        self.bytes.copy_from_slice(bytes);
        self.torn.copy_from_slice(torn);
    }

    /// Whether an operation is in progress.
    pub fn is_busy(&self, now: u64) -> bool {
        now < self.busy_until
    }

    /// Whether an access to this address waits for the end of an operation: both can only be in the stored part.
    pub fn delays(&self, address: u32, now: u64) -> bool {
        self.is_busy(now) && (address >= BANK_2 || self.options & DBANK == 0)
    }

    /// Whether the code has double words whose check code is wrong.
    pub fn has_bad_code(&self) -> bool {
        self.bad_code.is_some() || !self.torn_code.is_empty()
    }

    /// Processes a read or a fetch of some bytes; returns whether their check code is wrong.
    pub fn is_bad(&mut self, address: u32, size: u32) -> bool {
        let bad = [self.bad_code.map_or(0..0, |bad| bad..bad + 8), self.torn_code.clone()];
        let bad = bad.into_iter().find(|bad| bad.start < address + size && address < bad.end);
        bad.inspect(|bad| self.note_error(bad.start)).is_some()
    }

    /// Lets the boot loader erase or program these addresses, double words of the code or of the stored part; power may
    /// fail meanwhile. The stored part gets these bytes.
    pub fn by_loader(&mut self, range: Range<u32>, bytes: &[u8]) {
        let lost = self.power_goes();
        if let Some(at) = range.start.checked_sub(STORED) {
            let at = at as usize;
            self.bytes[at..at + bytes.len()].copy_from_slice(bytes);
            self.torn[at / 8..(at + bytes.len()) / 8].fill(lost);
        } else if lost {
            self.torn_code = range;
        } else if range.contains(&self.torn_code.start) {
            self.torn_code = 0..0;
        }
    }

    fn note_error(&mut self, address: u32) {
        let bank = u32::from(address >= BANK_2);
        self.eccr = ECCD | bank << 21 | ((address - FLASH) % (FLASH_SIZE / 2) / 8);
    }

    /// Interrupts power: an operation in progress leaves its double words torn.
    pub fn cut(&mut self, now: u64) {
        if self.is_busy(now) {
            self.torn[self.changing.clone()].fill(true);
        }
    }

    /// Returns a word of the stored part, and whether its check code is wrong.
    pub fn load(&mut self, address: u32) -> (u32, bool) {
        let at = (address - STORED) as usize & !3;
        let word = self.bytes[at..].first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let torn = self.torn.get(at / 8) == Some(&true);
        if torn {
            self.note_error(address);
        }
        (word, torn)
    }

    /// Whether power fails in the operation that begins now.
    fn power_goes(&mut self) -> bool {
        self.operations += 1;
        self.power_lost |= self.power_loss_at == Some(self.operations);
        self.power_lost
    }

    /// Programs a word; two words make an operation. `None` is a write that is not 32 bits wide or not allowed.
    pub fn store(&mut self, address: u32, value: u32, now: u64) -> Option<Effect> {
        let cr = self.store.get(CR);
        if self.power_lost {
            return Some(Effect::None);
        }
        if cr & (PG | LOCK) != PG || self.is_busy(now) {
            self.status |= PGSERR;
            return Some(Effect::None);
        }
        match self.half.take() {
            None if address.is_multiple_of(8) => self.half = Some((address, value)),
            Some((at, low)) if address == at + 4 => self.program(at, low, value, now),
            _ => self.status |= PGSERR | SIZERR,
        }
        // Other accesses may have to wait from now on.
        Some(Effect::Look)
    }

    fn program(&mut self, address: u32, low: u32, high: u32, now: u64) {
        let at = (address - STORED) as usize;
        let new = u64::from(low) | u64::from(high) << 32;
        let Some(place) = self.bytes[at..].first_chunk_mut() else { return };
        let old = u64::from_le_bytes(*place);
        // Only erased double words may be programmed, or any with all zeros.
        if old != u64::MAX && new != 0 {
            self.status |= PROGERR;
            return;
        }
        *place = (old & new).to_le_bytes();
        self.changing = at / 8..at / 8 + 1;
        self.torn[at / 8] = self.power_goes();
        self.busy_until = now + PROGRAM;
        self.status |= EOP;
    }

    fn erase(&mut self, cr: u32, now: u64) {
        self.busy_until = now + ERASE;
        let number = (cr >> 3 & 0x7f) as usize;
        // Pages are counted from the beginning of a bank; with a single bank they are twice as long.
        let (bank, size) = match (self.options & DBANK != 0, cr & BKER != 0) {
            (true, true) => (BANK_2, PAGE),
            (true, false) => (FLASH, PAGE),
            (false, _) => (FLASH, 2 * PAGE),
        };
        let Some(start) = (bank as usize + number * size).checked_sub(STORED as usize) else {
            // A page of the code.
            self.status |= PROGERR;
            return;
        };
        let lost = self.power_goes();
        self.bytes[start..start + size].fill(0xff);
        self.changing = start / 8..(start + size) / 8;
        self.torn[self.changing.clone()].fill(lost);
        self.status |= EOP;
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        Some(match offset {
            SR => self.status | if self.is_busy(now) { BSY } else { 0 },
            ECCR => self.eccr,
            OPTR => self.options,
            _ => return self.store.read(offset),
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Rules) -> Option<Effect> {
        let now = rules.now;
        let cr = self.store.get(CR);
        match offset {
            KEYR => {
                self.keys = if KEYS.get(self.keys) == Some(&value) { self.keys + 1 } else { 0 };
                if self.keys == 2 {
                    self.store.write(CR, cr & !LOCK);
                    self.keys = 0;
                }
            }
            SR => self.status &= !value,
            ECCR => self.eccr &= !value,
            // While locked, only the lock itself may be set again.
            CR if cr & LOCK != 0 => {}
            CR => {
                let works = value & PG != 0 || value & (STRT | PER) == STRT | PER;
                let cached = self.store.get(ACR) & DCEN != 0;
                rules.require(!(works && cached), Rule::DataCache, || {
                    "FLASH_CR: an erasure or a programming with ACR.DCEN on".into()
                });
                self.store.write(CR, value & !STRT);
                self.half = None;
                if value & (STRT | PER) == STRT | PER && !self.power_lost {
                    self.erase(value, now);
                }
            }
            _ => return self.store.write(offset, value),
        }
        Some(Effect::Look)
    }
}
