//! TIM2 as counter of the encoder (RM0440, section 30): it counts together with the encoder outside, from 0 at its
//! start, in encoder mode 3 only.

use super::{Effect, Store, offsets};

offsets! { CR1 = 0x00, SMCR = 0x08, CNT = 0x24 }

defaults! {
    /// The timer; by default after a reset, with the encoder at 0.
    #[derive(Clone, Debug)]
    pub struct EncoderTimer {
        store: Store = Store::of("TIM2"),
        /// Position of the encoder, counts.
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

    /// Returns the counter.
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
