//! The terminals of the strip by their names, and the states of their wires.

use core::fmt;

use thiserror::Error;

/// The terminals: first the analog ones, then the contacts, then the outputs.
#[rustfmt::skip]
pub const TERMINALS: [&str; 13] = [
    "REFERENCE", "REFERENCE2", "MOTOR SENSOR",
    "ENABLE", "START", "STOP", "REVERSE", "RESET", "PRESET1", "PRESET2",
    "RUN", "FAULT", "BRAKE",
];
/// Number of analog terminals, and of contacts.
pub const ANALOG: usize = 3;
/// See [`ANALOG`].
pub const CONTACTS: usize = 7;

/// Contacts that are closed, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wires(pub u8);

#[allow(missing_docs)] // the page says what they do
impl Wires {
    pub const ENABLE: Self = Self(1);
    pub const START: Self = Self(1 << 1);
    pub const STOP: Self = Self(1 << 2);
    pub const REVERSE: Self = Self(1 << 3);
    pub const RESET: Self = Self(1 << 4);

    /// Whether all of these wires are closed.
    pub const fn has(self, others: Self) -> bool {
        self.0 & others.0 == others.0
    }

    /// The number of the preset speed; 0: none.
    pub const fn preset(self) -> usize {
        (self.0 >> 5 & 3) as usize
    }
}

impl fmt::Display for Wires {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = TERMINALS.iter().skip(ANALOG).take(CONTACTS).enumerate();
        let mut closed = names.filter(|(n, _)| self.0 >> n & 1 == 1);
        closed.try_for_each(|(_, name)| write!(f, " {name}"))
    }
}

/// Reason why a reference counts as lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Lost {
    /// The ADC gives no result.
    #[error("its ADC does not answer")]
    Silent,
    /// Below 3.6 mA.
    #[error("below 3.6 mA: a broken wire, or no supply")]
    Low,
    /// Above 21 mA.
    #[error("above 21 mA: a short circuit")]
    High,
    /// At the end of the ADC's range.
    #[error("at the end of the ADC's range")]
    End,
    /// Two inputs that should agree differ.
    #[error("the two inputs differ by more than 0.3 V")]
    Differ,
}
