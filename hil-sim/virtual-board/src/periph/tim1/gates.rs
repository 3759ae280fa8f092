//! The gate signals that the timer's registers make.

use super::{BDTR, CCER, CCMR1, CCMR2, CR1, Tim1};

/// Limits of the gate signals, ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GateLimits {
    /// Shortest dead time between the switches of a leg.
    pub dead_time: u32,
    /// Shortest pulse that the gate drives pass on.
    pub pulse: u32,
}

/// A violation of the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadGates {
    /// The switches of leg `leg` may be on together: the dead time in ticks.
    Short {
        /// Leg, 0 is a.
        leg: usize,
        /// Dead time that is programmed.
        dead_time: u32,
    },
    /// A switch of leg `leg` is on for too short a time.
    Pulse {
        /// Leg, 0 is a.
        leg: usize,
        /// Ticks.
        ticks: u32,
    },
    /// The outputs of a leg are not complementary in PWM mode 1, active high.
    NotComplementary,
}

impl Tim1 {
    /// Dead time, ticks.
    pub fn dead_time(&self) -> u32 {
        let code = self.store.get(BDTR) & 0xff;
        // CKD: the dead time counts every clock, every second or every fourth.
        let clocks = [1, 2, 4, 4][(self.store.get(CR1) >> 8 & 3) as usize];
        clocks
            * match code >> 5 {
                0..=3 => code,
                4 | 5 => 2 * (64 + (code & 0x3f)),
                6 => 8 * (32 + (code & 0x1f)),
                _ => 16 * (32 + (code & 0x1f)),
            }
    }

    /// Checks the gate signals of a period with the compare values in force.
    ///
    /// # Errors
    /// The first violation of the limits.
    pub fn check_gates(&self, limits: GateLimits) -> Result<(), BadGates> {
        if !self.outputs_on() {
            return Ok(());
        }
        // Both outputs of three legs, active high, PWM mode 1: nothing else is known to be safe.
        let modes =
            [self.store.get(CCMR1) >> 4, self.store.get(CCMR1) >> 12, self.store.get(CCMR2) >> 4];
        if self.store.get(CCER) & 0xfff != 0x555 || modes.iter().any(|mode| mode & 7 != 6) {
            return Err(BadGates::NotComplementary);
        }
        let dead_time = self.dead_time();
        for (leg, compare) in self.in_force().into_iter().enumerate() {
            if dead_time < limits.dead_time {
                return Err(BadGates::Short { leg, dead_time });
            }
            let compare = compare.min(self.top);
            for on in [2 * compare, 2 * (self.top - compare)] {
                let ticks = on.saturating_sub(dead_time);
                // A whole period has no edges and so no dead time; a vanished pulse is none.
                if on != 2 * self.top && ticks > 0 && ticks < limits.pulse {
                    return Err(BadGates::Pulse { leg, ticks });
                }
            }
        }
        Ok(())
    }
}
