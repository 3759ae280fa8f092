//! The window watchdog: resets the chip when the control interrupt does not come for three periods, or comes far too early. The
//! independent watchdog, which the main loop feeds, takes 5 ms for that.

use stm32g4xx_hal::pac::WWDG;
use stm32g4xx_hal::rcc::Rcc;

use super::StartError;
use super::clocks::clock_on;
use crate::board::{LONGEST_INTERRUPT_CYCLES, PERIOD_TICKS};

/// Core cycles per count.
const CLOCK: u32 = 4096;
/// The last value before a reset.
const LAST: u32 = 0x40;
/// Counts from one feeding to the reset; the first count may be cut short.
const COUNTS: u32 = 3 * PERIOD_TICKS / CLOCK;
/// Counts after a feeding within which the next feeding is too early.
const CLOSED: u32 = (PERIOD_TICKS - LONGEST_INTERRUPT_CYCLES) / CLOCK;
const RELOAD: u8 = (LAST + COUNTS - 1) as u8;
// The counts fit seven bits, and a period that is late by the longest interrupt causes no reset.
const _: () = assert!(
    RELOAD < 0x80 && (COUNTS - 1) * CLOCK > PERIOD_TICKS + LONGEST_INTERRUPT_CYCLES && CLOSED > 0
);

/// The watchdog.
pub struct Window(WWDG);

impl Window {
    /// The watchdog, with the window open; the first [`feed`](Self::feed) starts it.
    ///
    /// # Errors
    /// It has no clock.
    pub fn new(timer: WWDG, rcc: &mut Rcc) -> Result<Self, StartError> {
        clock_on!(rcc.apb1enr1(), wwdgen, "the window watchdog")?;
        Ok(Self(timer))
    }

    /// Closes the window of a watchdog that is being fed. (Before the first feeding, its counter may have any value, and that feeding
    /// would be too early.)
    pub fn close() {
        // SAFETY: only this function uses the register.
        let timer = unsafe { &*WWDG::ptr() };
        // Undivided beyond CLOCK, no interrupt.
        timer.cfr().write(|w| w.w().set(RELOAD - CLOSED as u8));
    }

    /// Feeds it.
    #[inline] // into the control interrupt
    pub fn feed(&mut self) {
        self.0.cr().write(|w| w.t().set(RELOAD).wdga().set_bit());
    }
}
