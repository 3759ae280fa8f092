//! The window watchdog (RM0440, section 43) on a bus clock of one tick a cycle. Its prescaler keeps running at any write.

use super::{Effect, NEVER, Store, offsets};

offsets! { CR = 0x00, CFR = 0x04 }
/// Cycles of the bus clock per count, before its own divider.
const CLOCK: u64 = 4096;
const WDGA: u32 = 1 << 7;
/// Bits of the counter and of the window.
const COUNT: u32 = 0x7f;
/// Counter value below which the chip is reset.
const LAST: u32 = 0x40;

defaults! {
    /// The watchdog.
    #[derive(Clone, Debug)]
    pub struct Wwdg {
        /// The counter as it was written last, with WDGA, and the time of that write.
        control: u32 = COUNT,
        written: u64,
        store: Store = Store::of("WWDG"),
        /// Time at which the counter runs out, or at which it was written outside the window.
        bites_at: u64 = NEVER,
    }
}

impl Wwdg {
    /// Returns the time at which it resets the chip.
    pub fn next_event(&self) -> u64 {
        self.bites_at
    }

    /// Accounts for a stop of its clock for some ticks.
    pub fn delay(&mut self, ticks: u64) {
        self.written += ticks;
        self.bites_at = self.bites_at.saturating_add(ticks);
    }

    /// Returns the ticks per count.
    fn divider(&self) -> u64 {
        CLOCK << (self.store.get(CFR) >> 11 & 7)
    }

    fn counter(&self, now: u64) -> u32 {
        let counts = now / self.divider() - self.written / self.divider();
        (self.control & COUNT).saturating_sub(counts.min(u64::from(COUNT)) as u32)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        match offset {
            CR => Some(self.control & WDGA | self.counter(now)),
            _ => self.store.read(offset),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        match offset {
            CR => {
                let runs = self.control & WDGA != 0;
                let early = runs && self.counter(now) > self.store.get(CFR) & COUNT;
                let counts = u64::from(value & COUNT).saturating_sub(u64::from(LAST) - 1);
                self.control = value & COUNT | (self.control | value) & WDGA;
                self.written = now;
                if self.control & WDGA != 0 {
                    let end = (now / self.divider() + counts) * self.divider();
                    self.bites_at = if early || counts == 0 { now } else { end };
                }
            }
            _ => return self.store.write(offset, value).map(|_| Effect::Look),
        }
        Some(Effect::Look)
    }
}
