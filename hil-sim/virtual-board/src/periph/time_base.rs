//! TIM5 as time base (RM0440, section 30): counts core clocks upwards while it is enabled, asleep or halted as well.

use super::{Effect, Store, registers};

const ALL: u32 = u32::MAX;
registers! {
    CR1 = 0x00, 0, 0x1bff;
    EGR = 0x14, 0, 0;
    CNT = 0x24, 0, 0;
    _ = 0x28, 0, 0xffff;
    _ = 0x2c, ALL, ALL;
}

/// The timer.
#[derive(Clone, Debug)]
pub struct TimeBase {
    store: Store,
    /// Time at which the counter was 0.
    from: u64,
}

impl Default for TimeBase {
    fn default() -> Self {
        Self { store: Store::new(KNOWN), from: 0 }
    }
}

impl TimeBase {
    /// Its clock stood still for some ticks.
    pub fn delay(&mut self, ticks: u64) {
        self.from += ticks;
    }

    /// Reads a register at the time `now`, ticks.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        match offset {
            CNT if self.store.get(CR1) & 1 == 0 => Some(0),
            CNT => Some((now - self.from) as u32),
            _ => self.store.read(offset),
        }
    }

    /// Writes a register at the time `now`, ticks.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        let counts = self.store.get(CR1) & 1 != 0;
        self.store.write(offset, value)?;
        if offset == EGR || (offset == CR1 && !counts) {
            self.from = now;
        }
        Some(Effect::None)
    }
}
