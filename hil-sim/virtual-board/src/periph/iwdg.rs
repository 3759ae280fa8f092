//! The independent watchdog (RM0440, section 42).

use super::{Effect, NEVER};
use crate::rules::{Rule, Rules};
use crate::time::TICKS_PER_S;

/// Frequency of the LSI oscillator, which clocks the watchdog, Hz (datasheet, typical).
pub const LSI_HZ: f64 = 32_000.0;
/// Largest number of clocks until a written value takes effect.
const ARRIVES: u64 = 6;

defaults! {
    /// The watchdog.
    #[derive(Clone, Debug)]
    pub struct Iwdg {
        prescaler: u32,
        reload: u32 = 0xfff,
        window: u32 = 0xfff,
        unlocked: bool,
        /// Whether these are clocks of the oscillator (RM0440, IWDG_SR) and not prescaled ones, which ST's driver allows for.
        pub quick: bool,
        /// Ticks per cycle of its clock.
        pub clock: u64 = (TICKS_PER_S as f64 / LSI_HZ) as u64,
        /// Time until which the last values of prescaler, reload and window are being transferred.
        busy_until: [u64; 3],
        expires: u64 = NEVER,
    }
}

impl Iwdg {
    /// Returns the time at which it resets the chip.
    pub fn next_event(&self) -> u64 {
        self.expires
    }

    fn period(&self) -> u64 {
        u64::from(self.reload + 1) * self.count()
    }

    /// Returns the ticks per prescaled clock.
    fn count(&self) -> u64 {
        (4 << self.prescaler.min(6)) * self.clock
    }

    /// Accounts for a stop of its clock for some ticks.
    pub fn delay(&mut self, ticks: u64) {
        self.expires = self.expires.saturating_add(ticks);
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        Some(match offset {
            0x00 => 0,
            0x04 => self.prescaler,
            0x08 => self.reload,
            0x0c => (0..3).fold(0, |w, n| w | u32::from(now < self.busy_until[n]) << n),
            0x10 => self.window,
            _ => return None,
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Rules) -> Option<Effect> {
        let now = rules.now;
        match offset {
            0x00 => {
                self.unlocked = value == 0x5555;
                let runs = self.expires != NEVER;
                if value == 0xcccc || value == 0xaaaa && runs {
                    self.expires = now + self.period();
                }
            }
            0x04 | 0x08 | 0x10 if self.unlocked => {
                let which = [0x04, 0x08, 0x10].iter().position(|known| *known == offset)?;
                let name = ["PR", "RLR", "WINR"][which];
                let idle = now >= self.busy_until[which];
                if !rules.require(idle, Rule::IwdgBusy, || format!("IWDG_{name} while it is busy"))
                {
                    return Some(Effect::None);
                }
                let before = self.count();
                *[&mut self.prescaler, &mut self.reload, &mut self.window][which] =
                    value & [7, 0xfff, 0xfff][which];
                // With the larger of the two prescalers, which gives the longest time.
                let clock = if self.quick { self.clock } else { before.max(self.count()) };
                self.busy_until[which] = now + ARRIVES * clock;
            }
            0x04 | 0x08 | 0x10 => {}
            _ => return None,
        }
        Some(Effect::Look)
    }
}
