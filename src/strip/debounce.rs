//! From contacts that bounce to wires that are closed or open.

use crate::terminals::{CONTACTS, Wires};

/// Looks, a millisecond each, in a row for which an input must be closed to count as closed.
pub const CLOSES: u8 = 20;
/// Looks in a row for which a closed one must be open to count as open: a broken wire and a button stop at once.
pub const OPENS: u8 = 2;

/// A count for each input, up at a closed look, down ten times as fast at an open one: an input that chatters comes out open, which
/// never starts and never lets run.
#[derive(Debug, Default)]
pub struct Debounce {
    counts: [u8; CONTACTS],
    closed: Wires,
}

impl Debounce {
    /// The wires after another look at the contacts. All are open at first.
    pub fn look(&mut self, contacts: Wires) -> Wires {
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
