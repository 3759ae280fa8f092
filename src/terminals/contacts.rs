//! The contacts at the terminals: which of them are closed.

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
