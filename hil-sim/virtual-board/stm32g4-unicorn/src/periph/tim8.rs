//! TIM8 with its first channel (RM0440, section 28): PWM mode 1, counting up. In other modes the
//! output is off in this model.

use super::{Store, bits, offsets};

offsets! { CR1 = 0x00, CCMR1 = 0x18, CCER = 0x20, ARR = 0x2c, CCR1 = 0x34, BDTR = 0x44 }

// CR1, CCER, BDTR.
bits! { CEN = 0 }
bits! { CC1E = 0 }
bits! { BKE = 12, MOE = 15 }
/// OC1M and CC1S.
const MODE: u32 = 0x1_0073;
const PWM_1: u32 = 0x60;

/// The timer.
#[derive(Clone, Debug)]
pub struct Tim8(pub Store);

impl Tim8 {
    /// Returns the share of a period in which its first output is high. A new compare value takes effect at once, not in the next period.
    pub fn duty(&self) -> f64 {
        let get = |offset| self.0.get(offset);
        let runs = get(CR1) & CEN != 0 && get(CCER) & CC1E != 0 && get(BDTR) & MOE != 0;
        if !runs || get(CCMR1) & MODE != PWM_1 {
            return 0.0;
        }
        f64::from(get(CCR1)) / (f64::from(get(ARR)) + 1.0)
    }

    /// Returns the bit MOE.
    pub fn main_output(&self) -> bool {
        self.0.get(BDTR) & MOE != 0
    }

    /// Processes a fault inside the chip, which pulls the break.
    pub fn system_break(&mut self) {
        let bdtr = self.0.get(BDTR);
        if bdtr & BKE != 0 {
            self.0.write(BDTR, bdtr & !MOE);
        }
    }
}
