//! Debug support (RM0440, section 47): no debugger is there.

use super::{Plain, Store};

const ALL: u32 = u32::MAX;
const KNOWN: &[Plain] =
    &[(0x00, 0x2019_6469, 0), (0x04, 0, ALL), (0x08, 0, ALL), (0x0c, 0, ALL), (0x10, 0, ALL)];

/// Debug support.
#[derive(Clone, Debug)]
pub struct Debug(Store);

impl Default for Debug {
    fn default() -> Self {
        Self(Store::new(KNOWN))
    }
}

impl Debug {
    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.0.read(offset)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        self.0.write(offset, value).map(drop)
    }
}
