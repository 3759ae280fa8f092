//! Operating hours, starts and faults that outlast resets: a log of double words in two pages of the flash.
//!
//! | double word | bits 0 to 7 | 8 to 31 | 32 to 63 |
//! |---|---|---|---|
//! | 0, header, written last | magic, 32 bits | | sequence number |
//! | time | 0x80 | time powered, minutes | time with current, s |
//! | starts | 0x81 | 0 | starts |
//! | fault | its number, 1 to 125 | time powered, minutes | time with current, s |
//! | change of a protective setting | 126 | time powered, minutes | its permanent number |
//!
//! A page is filled from its beginning. When it is full, the other is erased, gets a time, the starts and the last faults,
//! and its header, by which it counts. A power failure tears the double word that is being written, which is passed over,
//! or leaves the page without its header, so that the full one still counts.
//!
//! Wear: a fault takes one double word, a time with the starts two. Time and starts are written once in [`OFF_S`] at most with the
//! outputs off and once in [`ON_S`] with them on, and the same fault again once in [`SAME_FAULT_S`]. A page with space for [`ROOM`]
//! entries lasts 9.8 hours of continuous starting and stopping, and two pages of 10 000 erasures (datasheet) last 22 years; with a fault
//! every minute besides, 6 years.

#[cfg(target_os = "none")]
mod hours;
#[cfg(any(target_os = "none", test))]
mod ripple;
#[cfg(test)]
mod tests;
mod words;

use heapless::Deque;

use crate::board;
use crate::store::{ERASED, Flash, FlashError, SLOT_WORDS, SLOTS, halves, newer, pair};
#[cfg(target_os = "none")]
pub use hours::Hours;
pub use words::line;

/// The slots of the history.
const PAGES: [usize; 2] = [SLOTS, SLOTS + 1];
const _: () = assert!(PAGES[1] < board::STORED_SLOTS);

/// Number of faults that are kept.
pub const FAULTS: usize = 16;
/// Shortest time between two times written with the outputs off, s.
pub const OFF_S: u32 = 300;
/// Shortest time between two times written with the outputs on, and for a drive that does nothing, s.
pub const ON_S: u32 = 900;
/// Shortest time between two times written with the outputs on in the second half of the page, s. The rest of the page lasts 19 days at
/// this rate, because the page is not erased with the outputs on.
pub const LONG_S: u32 = 16 * ON_S;
/// Shortest time between two equal faults that are both written, s.
pub const SAME_FAULT_S: u32 = 60;
/// Double words for entries while a page is in use.
pub const ROOM: usize = SLOT_WORDS - 1 - 2 - FAULTS;

/// "idhl": marks a page.
const MAGIC: u32 = 0x6c68_6469;
const TIME: u8 = 0x80;
const STARTS: u8 = 0x81;
const LAST_FAULT: u8 = 0x7f;
/// Value in place of the number of a fault: a protective setting was changed.
pub const CHANGED: u8 = 0x7e;

/// A fault of the past, or a change of a protective setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PastFault {
    /// Number of the fault, or [`CHANGED`].
    pub code: u8,
    /// Time powered until then, minutes.
    pub powered_min: u32,
    /// Time with current until then, s; or the number of the changed setting.
    pub running_s: u32,
}

/// The history, and the place where its log continues.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Time powered beyond the last whole second, ms.
    ms: u32,
    /// Time powered, s.
    pub powered_s: u32,
    /// Time with current, s; `running_ms` is the rest, ms.
    pub running_s: u32,
    running_ms: u32,
    /// Number of starts.
    pub starts: u32,
    /// Errors that the flash has corrected since the last reset.
    pub corrected: u32,
    /// How often since the last reset the ripple of the dc link was too large.
    pub ripples: u32,
    faults: Deque<PastFault, FAULTS>,
    page: usize,
    sequence: u32,
    /// The next double word; 0 before the first page was begun.
    next: usize,
    /// Starts and time with current in the log, and `powered_s` of the last record.
    written: (u32, u32, u32),
}

fn record(kind: u8, middle: u32, high: u32) -> u64 {
    pair(middle << 8 | u32::from(kind), high)
}

impl History {
    /// Reads the log.
    pub fn load(flash: &mut impl Flash) -> Self {
        let newest = newer(PAGES.map(|slot| {
            let (magic, sequence) = halves(flash.read(slot, 0)?);
            (magic == MAGIC).then_some(sequence)
        }));
        let Some((page, sequence)) = newest else {
            return Self { next: SLOT_WORDS, ..Self::default() };
        };
        let mut history = Self { page, sequence, next: 1, ..Self::default() };
        for word in 1..SLOT_WORDS {
            let content = flash.read(PAGES[page], word);
            if content != Some(ERASED) {
                history.next = word + 1;
                history.take(content.unwrap_or(0));
            }
        }
        history.written = (history.starts, history.running_s, history.powered_s);
        history
    }

    /// Takes a double word of the log.
    fn take(&mut self, word: u64) {
        let (low, high) = halves(word);
        let (kind, middle) = (low as u8, low >> 8);
        match kind {
            STARTS => self.starts = high,
            TIME => (self.powered_s, self.running_s) = (60 * middle, high),
            1..=LAST_FAULT => {
                let fault = PastFault { code: kind, powered_min: middle, running_s: high };
                // An equal entry is a second attempt after an apparent write error.
                if self.faults.back() != Some(&fault) {
                    self.remember(fault);
                }
                // The faults at the beginning of a page are older than its time.
                self.powered_s = self.powered_s.max(60 * middle);
                if kind != CHANGED {
                    self.running_s = self.running_s.max(high);
                }
            }
            _ => {}
        }
    }

    fn remember(&mut self, fault: PastFault) {
        if self.faults.is_full() {
            self.faults.pop_front();
        }
        // The list has enough space.
        let _ = self.faults.push_back(fault);
    }

    /// The last faults, the latest first.
    pub fn faults(&self) -> impl Iterator<Item = &PastFault> {
        self.faults.iter().rev()
    }

    /// Lets time pass, ms, with current or without.
    pub fn pass(&mut self, ms: u32, on: bool) {
        self.ms += ms;
        self.powered_s += self.ms / 1000;
        self.ms %= 1000;
        if on {
            self.running_ms += ms;
            self.running_s += self.running_ms / 1000;
            self.running_ms %= 1000;
        }
    }

    /// Notes a start.
    pub fn started(&mut self) {
        self.starts = self.starts.wrapping_add(1);
    }

    /// Notes a fault and writes it, with the outputs off.
    ///
    /// # Errors
    /// The flash failed. The fault is kept until the next reset.
    pub fn fault(&mut self, flash: &mut impl Flash, code: u8) -> Result<(), FlashError> {
        self.note(flash, code, self.running_s)
    }

    /// Notes that the protective setting with this number was changed, and writes it.
    ///
    /// # Errors
    /// As [`fault`](Self::fault).
    pub fn changed(&mut self, flash: &mut impl Flash, setting: u16) -> Result<(), FlashError> {
        self.note(flash, CHANGED, setting.into())
    }

    fn note(&mut self, flash: &mut impl Flash, code: u8, last: u32) -> Result<(), FlashError> {
        let fault = PastFault { code, powered_min: self.powered_s / 60, running_s: last };
        let same = self.faults.back().is_some_and(|before| {
            before.code == code
                && (code != CHANGED || before.running_s == last)
                && self.powered_s - 60 * before.powered_min < SAME_FAULT_S
        });
        if same {
            return Ok(());
        }
        self.remember(fault);
        if self.is_full() {
            return self.turn(flash);
        }
        self.append(flash, record(code, fault.powered_min, fault.running_s))
    }

    /// Whether the next write erases a page, which takes 22 ms.
    pub fn is_full(&self) -> bool {
        self.next + 2 > SLOT_WORDS
    }

    /// Whether times are to be written now. A full page waits until the outputs are off.
    pub fn is_due(&self, off: bool) -> bool {
        let (starts, running_s, powered_s) = self.written;
        let since = self.powered_s - powered_s;
        let changed = starts != self.starts || running_s != self.running_s;
        if off {
            return since >= if changed { OFF_S } else { ON_S };
        }
        let sparing = 2 * self.next > SLOT_WORDS;
        !self.is_full() && since >= if sparing { LONG_S } else { ON_S }
    }

    /// Writes times and starts.
    ///
    /// # Errors
    /// The flash failed; the next attempt comes as late as after a success.
    pub fn write(&mut self, flash: &mut impl Flash) -> Result<(), FlashError> {
        let before =
            core::mem::replace(&mut self.written, (self.starts, self.running_s, self.powered_s));
        if self.is_full() {
            return self.turn(flash);
        }
        self.append(flash, record(TIME, self.powered_s / 60, self.running_s))?;
        if before.0 != self.starts {
            self.append(flash, record(STARTS, 0, self.starts))?;
        }
        Ok(())
    }

    /// Begins the other page.
    fn turn(&mut self, flash: &mut impl Flash) -> Result<(), FlashError> {
        let (page, sequence) = (1 - self.page, self.sequence.wrapping_add(1));
        flash.erase(PAGES[page])?;
        let head =
            [record(STARTS, 0, self.starts), record(TIME, self.powered_s / 60, self.running_s)];
        let faults =
            self.faults.iter().map(|fault| record(fault.code, fault.powered_min, fault.running_s));
        let mut next = 1;
        for word in head.into_iter().chain(faults) {
            flash.write(PAGES[page], next, word)?;
            next += 1;
        }
        flash.write(PAGES[page], 0, pair(MAGIC, sequence))?;
        (self.page, self.sequence, self.next) = (page, sequence, next);
        self.written = (self.starts, self.running_s, self.powered_s);
        Ok(())
    }

    /// Programs the next double word. If that fails, programs the one after it, because a power failure may have left the first neither
    /// erased nor readable as written.
    fn append(&mut self, flash: &mut impl Flash, word: u64) -> Result<(), FlashError> {
        let mut result = Err(FlashError::Verify(self.next));
        for at in (self.next..SLOT_WORDS).take(2) {
            self.next = at + 1;
            result = flash.write(PAGES[self.page], at, word);
            if result.is_ok() {
                break;
            }
        }
        result
    }
}
