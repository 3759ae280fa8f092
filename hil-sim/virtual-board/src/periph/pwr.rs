//! Supply (RM0440, section 6): the regulator is always ready.

use super::{Effect, Plain, Store};

const ALL: u32 = u32::MAX;
const KNOWN: &[Plain] = &[
    (0x00, 0x200, ALL),
    (0x04, 0, ALL),
    (0x08, 0x8000, ALL),
    (0x0c, 0, ALL),
    (0x10, 0, 0),
    (0x14, 0, 0),
    (0x18, 0, 0),
    (0x20, 0, ALL),
    (0x24, 0, ALL),
    (0x28, 0, ALL),
    (0x2c, 0, ALL),
    (0x80, 0x100, ALL),
];

/// The supply.
#[derive(Clone, Debug)]
pub struct Pwr(Store);

impl Default for Pwr {
    fn default() -> Self {
        Self(Store::new(KNOWN))
    }
}

impl Pwr {
    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.0.read(offset)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        self.0.write(offset, value)
    }
}
