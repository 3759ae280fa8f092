//! System configuration (RM0440, section 10).

use super::{Effect, Plain, Store};

const ALL: u32 = u32::MAX;
const SYSCFG: &[Plain] = &[
    (0x00, 0, ALL),
    (0x04, 0x7c00_0001, ALL),
    (0x08, 0, ALL),
    (0x0c, 0, ALL),
    (0x10, 0, ALL),
    (0x14, 0, ALL),
    (0x18, 0, ALL),
    (0x1c, 0, ALL),
    (0x20, 0, ALL),
    (0x24, 0, ALL),
];

/// System configuration.
#[derive(Clone, Debug)]
pub struct Syscfg(Store);

impl Default for Syscfg {
    fn default() -> Self {
        Self(Store::new(SYSCFG))
    }
}

impl Syscfg {
    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.0.read(offset)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        self.0.write(offset, value)
    }

    /// CFGR2.CLL: a lock-up of the core goes to the breaks of the timers.
    pub fn lock_up_breaks(&self) -> bool {
        self.0.get(CFGR2) & 1 != 0
    }

    /// CFGR2.ECCL: an error that the flash cannot correct does.
    pub fn flash_error_breaks(&self) -> bool {
        self.0.get(CFGR2) & 1 << 3 != 0
    }
}

const CFGR2: u32 = 0x18;
