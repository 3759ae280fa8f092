//! The independent watchdog (RM0440, section 42), with the typical 32 kHz.

use super::{Effect, NEVER};

/// Ticks per cycle of its clock.
const CLOCK: u64 = 170_000_000 / 32_000;
/// Clocks until a value written has arrived.
const ARRIVES: u64 = 5;

/// The watchdog.
#[derive(Clone, Debug)]
pub struct Iwdg {
    prescaler: u32,
    reload: u32,
    window: u32,
    unlocked: bool,
    busy_until: u64,
    expires: u64,
}

impl Default for Iwdg {
    fn default() -> Self {
        Self {
            prescaler: 0,
            reload: 0xfff,
            window: 0xfff,
            unlocked: false,
            busy_until: 0,
            expires: NEVER,
        }
    }
}

impl Iwdg {
    /// When it resets the chip.
    pub fn next_event(&self) -> u64 {
        self.expires
    }

    /// Whether it does now.
    pub fn expired(&self, now: u64) -> bool {
        now >= self.expires
    }

    fn period(&self) -> u64 {
        u64::from(self.reload + 1) * (4 << self.prescaler.min(6)) * CLOCK
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        Some(match offset {
            0x00 => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            // Both values on their way.
            0x0c if now < self.busy_until => 3,
            0x0c => 0,
            0x10 => self.window,
            _ => return None,
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        match (offset, value) {
            (0x00, 0x5555) => self.unlocked = true,
            (0x00, 0xaaaa) => {
                self.unlocked = false;
                if self.expires != NEVER {
                    self.expires = now + self.period();
                }
            }
            (0x00, 0xcccc) => {
                self.unlocked = false;
                self.expires = now + self.period();
            }
            (0x00, _) => self.unlocked = false,
            (0x04 | 0x08, _) if self.unlocked => {
                if offset == 0x04 {
                    self.prescaler = value & 7
                } else {
                    self.reload = value & 0xfff
                }
                self.busy_until = now + ARRIVES * CLOCK;
            }
            (0x04 | 0x08, _) => {}
            _ => return None,
        }
        Some(Effect::Look)
    }
}
