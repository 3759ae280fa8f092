//! The time base: TIM5 counts core clocks, 32 bits, wrapping every 25 s.
//!
//! Not the cycle counter of the core, which stands still while the core sleeps unless a debug probe keeps its clock on, and
//! not stopped by a halt of the core: after a halt the control interrupt sees the gap.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::StartError;
use super::clocks::clock_on;

/// Starts the counter.
///
/// # Errors
/// It has no clock.
pub fn start(timer: pac::TIM5, rcc: &mut Rcc, debug: &pac::DBGMCU) -> Result<(), StartError> {
    clock_on!(rcc.apb1enr1(), tim5en, "TIM5")?;
    // A debugger may have set it, and only a power cycle clears it.
    debug.apb1l_fz().modify(|_, w| w.dbg_tim5_stop().clear_bit());
    timer.psc().write(|w| w.psc().set(0));
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.egr().write(|w| w.ug().update());
    timer.cr1().write(|w| w.cen().enabled());
    Ok(())
}

/// Core clocks since the start, wrapping; 0 before it.
pub fn now() -> u32 {
    // SAFETY: TIM5 always exists, and reading its counter changes nothing. Its clock is on from `start` on; before, the
    // read gives 0.
    unsafe { &*pac::TIM5::ptr() }.cnt().read().bits()
}
