//! The time base: TIM5 counts core clocks, 32 bits, wrapping every 25 s.
//!
//! It is not the cycle counter of the core, which stops while the core sleeps unless a debug probe keeps its clock on. TIM5 does not stop
//! when the core is halted: after a halt the control interrupt sees the gap.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::StartError;
use super::clocks::clock_on;
use crate::board;

/// Starts the counter.
///
/// # Errors
/// The timer has no clock.
pub fn start(timer: pac::TIM5, rcc: &mut Rcc, debug: &pac::DBGMCU) -> Result<(), StartError> {
    clock_on!(rcc.apb1enr1(), tim5en, "TIM5")?;
    // A debugger may have set the bit, and only a power cycle clears it.
    debug.apb1l_fz().modify(|_, w| w.dbg_tim5_stop().clear_bit());
    timer.psc().write(|w| w.psc().set(0));
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.egr().write(|w| w.ug().update());
    // The capture takes every eighth edge of the watchdog's oscillator, at input 1 (RM0440, TIM5_TISEL).
    rcc.csr().modify(|_, w| w.lsion().on());
    // SAFETY: four bits, an existing input.
    timer.tisel().write(|w| unsafe { w.ti1sel().bits(1) });
    timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1psc().eight_events());
    timer.ccer().write(|w| w.cc1e().set_bit());
    timer.cr1().write(|w| w.cen().enabled());
    Ok(())
}

/// Core clocks since the start, wrapping; 0 before it.
#[inline] // into the control interrupt
pub fn now() -> u32 {
    // SAFETY: TIM5 always exists, and reading its counter changes nothing. Its clock is on after `start`; before, the read gives 0.
    unsafe { &*pac::TIM5::ptr() }.cnt().read().bits()
}

/// Core clocks from one capture of the watchdog's oscillator to the next; `None` if no capture comes, or one was missed. Waits for
/// [`board::LSI_TIMEOUT_US`] at most.
pub fn lsi_clocks() -> Option<u32> {
    // SAFETY: TIM5 always exists; nothing else uses its status and its capture.
    let timer = unsafe { &*pac::TIM5::ptr() };
    let began = now();
    let capture = || {
        while !timer.sr().read().cc1if().bit() {
            if now().wrapping_sub(began) > board::LSI_TIMEOUT_US * board::CYCLES_PER_US {
                return None;
            }
        }
        Some(timer.ccr1().read().bits())
    };
    // SAFETY: clears all flags, those of the captures so far among them.
    timer.sr().write(|w| unsafe { w.bits(0) });
    let (first, second) = (capture()?, capture()?);
    let missed = timer.sr().read().cc1of().bit();
    (!missed).then_some(second.wrapping_sub(first))
}
