//! The contacts at the terminals: which of them are closed, and how bouncing ones settle.

use core::fmt;

use crate::boards::{ANALOG, CONTACTS, TERMINALS};

/// Contacts that are closed, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts(pub u8);

#[allow(missing_docs)] // the page says what they do
impl Contacts {
    pub const ENABLE: Self = Self(1);
    pub const START: Self = Self(1 << 1);
    pub const STOP: Self = Self(1 << 2);
    pub const REVERSE: Self = Self(1 << 3);
    pub const RESET: Self = Self(1 << 4);

    /// Whether all of these contacts are closed.
    pub const fn has(self, others: Self) -> bool {
        self.0 & others.0 == others.0
    }

    /// The number of the preset speed; 0: none.
    pub const fn preset(self) -> usize {
        (self.0 >> 5 & 3) as usize
    }
}

impl fmt::Display for Contacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = TERMINALS.iter().skip(ANALOG).take(CONTACTS).enumerate();
        let mut closed = names.filter(|(n, _)| self.0 >> n & 1 == 1);
        closed.try_for_each(|(_, name)| write!(f, " {name}"))
    }
}

/// Consecutive readings, one per millisecond, for which an input must be closed to count as closed.
pub const CLOSES: u8 = 20;
/// Consecutive readings for which a closed input must be open to count as open: a broken wire and a button stop at once.
pub const OPENS: u8 = 2;

/// A count for each input, up at a closed reading, down ten times as fast at an open one. An input that chatters counts as open, so it
/// neither starts the drive nor lets it run.
#[derive(Debug, Default)]
pub struct Debounce {
    counts: [u8; CONTACTS],
    closed: Contacts,
}

impl Debounce {
    /// The debounced contacts after another reading. All are open at first.
    pub fn look(&mut self, contacts: Contacts) -> Contacts {
        for (n, count) in self.counts.iter_mut().enumerate() {
            let bit = 1 << n;
            *count = match contacts.0 & bit {
                0 => count.saturating_sub(CLOSES / OPENS),
                _ => (*count + 1).min(CLOSES),
            };
            match *count {
                0 => self.closed.0 &= !bit,
                CLOSES => self.closed.0 |= bit,
                _ => {}
            }
        }
        self.closed
    }
}
