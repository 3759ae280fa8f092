//! Supply (RM0440, section 6): voltage range, supply monitor. The regulator is always ready.

use super::{Effect, Store, bits, offsets};

offsets! { CR1 = 0x00, CR2 = 0x04, SR2 = 0x14, CR5 = 0x80 }
bits! { PVDE = 0, DBP = 8, PVDO = 11 }
/// Levels of the supply monitor for a falling supply, V (datasheet, typical), by PVDLS; the last setting compares a pin.
const LEVELS: [f64; 7] = [2.05, 2.2, 2.36, 2.52, 2.64, 2.81, 2.9];

/// The core's voltage range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Range 1, boosted.
    Boost,
    /// Range 1.
    Normal,
    /// Range 2.
    Low,
}

impl Range {
    /// Returns the largest system clock, and the bus clock for each wait state of the flash and one more, Hz.
    pub fn clocks_hz(self) -> (u64, u64) {
        match self {
            Self::Boost => (170_000_000, 34_000_000),
            Self::Normal => (150_000_000, 30_000_000),
            Self::Low => (26_000_000, 12_000_000),
        }
    }

    /// Returns the wait states of the flash that a bus clock in Hz needs.
    pub fn wait_states(self, bus_hz: u64) -> u32 {
        (bus_hz.div_ceil(self.clocks_hz().1) as u32).saturating_sub(1)
    }
}

defaults! {
    /// The supply.
    #[derive(Clone, Debug)]
    pub struct Pwr {
        store: Store = Store::of("PWR"),
        /// Supply of the chip, V.
        pub supply_v: f64 = 3.3,
    }
}

impl Pwr {
    /// The voltage range.
    pub fn range(&self) -> Range {
        match (self.store.get(CR1) >> 9 & 3, self.store.get(CR5) >> 8 & 1) {
            (2, _) => Range::Low,
            (_, 0) => Range::Boost,
            _ => Range::Normal,
        }
    }

    /// Whether the backup registers can be written.
    pub fn opens_backup(&self) -> bool {
        self.store.get(CR1) & DBP != 0
    }

    /// Whether the supply monitor is on.
    pub fn monitors(&self) -> bool {
        self.store.get(CR2) & PVDE != 0
    }

    /// Whether the supply monitor finds the supply too low.
    pub fn too_low(&self) -> bool {
        let level = LEVELS.get((self.store.get(CR2) >> 1 & 7) as usize);
        self.monitors() && level.is_some_and(|level| self.supply_v < *level)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let value = self.store.read(offset)?;
        Some(if offset == SR2 && self.too_low() { value | PVDO } else { value })
    }

    /// Writes a register; the monitor may be locked by SYSCFG.
    pub fn write(&mut self, offset: u32, value: u32, locked: bool) -> Option<Effect> {
        let value = match offset {
            CR2 if locked => value & !0xf | self.store.get(CR2) & 0xf,
            _ => value,
        };
        self.store.write(offset, value).map(|_| Effect::Look)
    }
}
