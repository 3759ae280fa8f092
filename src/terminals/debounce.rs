//! Turns bouncing contacts into contacts that are closed or open.

use crate::boards::CONTACTS;
use crate::terminals::contacts::Contacts;

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
