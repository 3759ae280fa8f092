//! TIM2 as counter of the encoder (RM0440, section 30): counts with the plant's, from 0 at its start,
//! in encoder mode 3 only.

use super::{Effect, Store, registers};

const ALL: u32 = u32::MAX;
registers! {
    CR1 = 0x00, 0, 0x1bff;
    _ = 0x04, 0, 0x02f5_fffd;
    SMCR = 0x08, 0, 0x0331_ffff;
    _ = 0x0c, 0, 0x00f0_7fff;
    _ = 0x10, 0, 0;
    _ = 0x18, 0, 0x0101_ffff;
    _ = 0x1c, 0, 0x0101_ffff;
    _ = 0x20, 0, 0x0033_ffff;
    CNT = 0x24, 0, 0;
    _ = 0x28, 0, 0xffff;
    _ = 0x2c, ALL, ALL;
}

defaults! {
    /// The timer; by default after a reset, with the encoder at 0.
    #[derive(Clone, Debug)]
    pub struct EncoderTimer {
        store: Store = Store::new(KNOWN),
        /// Where the encoder is, counts.
        pub position: u32,
        from: u32,
        held: u32,
    }
}

impl EncoderTimer {
    /// Whether it counts the encoder.
    pub fn counting(&self) -> bool {
        self.store.get(CR1) & 1 != 0 && self.store.get(SMCR) & 7 == 3
    }

    /// The counter.
    pub fn count(&self) -> u32 {
        if self.counting() { self.position.wrapping_sub(self.from) } else { self.held }
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        if offset == CNT { Some(self.count()) } else { self.store.read(offset) }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        self.held = if offset == CNT { value } else { self.count() };
        self.store.write(offset, value)?;
        self.from = self.position.wrapping_sub(self.held);
        Some(Effect::None)
    }
}
