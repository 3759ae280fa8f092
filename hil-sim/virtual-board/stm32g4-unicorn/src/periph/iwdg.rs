//! The independent watchdog (RM0440, section 42).

use super::{Effect, NEVER, Store, offsets, rcc::TICKS_PER_S};
use crate::rules::{Rule, Rules};

offsets! { PR = 0x04, RLR = 0x08, SR = 0x0c, WINR = 0x10 }
/// Frequency of the LSI oscillator, which clocks the watchdog, Hz (datasheet, typical).
pub const LSI_HZ: f64 = 32_000.0;
/// Largest number of clocks until a written value takes effect.
const ARRIVES: u64 = 6;

defaults! {
    /// The watchdog.
    #[derive(Clone, Debug)]
    pub struct Iwdg {
        store: Store = Store::of("IWDG"),
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
        u64::from(self.store.get(RLR) + 1) * self.count()
    }

    /// Returns the ticks per prescaled clock.
    fn count(&self) -> u64 {
        (4 << self.store.get(PR).min(6)) * self.clock
    }

    /// Accounts for a stop of its clock for some ticks.
    pub fn delay(&mut self, ticks: u64) {
        self.expires = self.expires.saturating_add(ticks);
    }

    /// Reads a register.
    pub fn read(&self, offset: u32, now: u64) -> Option<u32> {
        match offset {
            SR => Some((0..3).fold(0, |w, n| w | u32::from(now < self.busy_until[n]) << n)),
            _ => self.store.read(offset),
        }
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
            PR | RLR | WINR if self.unlocked => {
                let which = [PR, RLR, WINR].iter().position(|known| *known == offset)?;
                let name = ["PR", "RLR", "WINR"][which];
                let idle = now >= self.busy_until[which];
                if !rules.require(idle, Rule::IwdgBusy, || format!("IWDG_{name} while it is busy"))
                {
                    return Some(Effect::None);
                }
                let before = self.count();
                self.store.write(offset, value);
                // With the larger of the two prescalers, which gives the longest time.
                let clock = if self.quick { self.clock } else { before.max(self.count()) };
                self.busy_until[which] = now + ARRIVES * clock;
            }
            PR | RLR | WINR => {}
            _ => return None,
        }
        Some(Effect::Look)
    }
}
