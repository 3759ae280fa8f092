//! The time base: TIM5 counts core clocks, 32 bits, wrapping every 25 s.
//!
//! It is not the cycle counter of the core, which stops while the core sleeps unless a debug probe keeps its clock on. TIM5 does not stop
//! when the core is halted: after a halt the control interrupt sees the gap.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::pac::tim5::RegisterBlock;
use stm32g4xx_hal::rcc::Rcc;

use super::StartError;
use super::clocks::clock_on;
use crate::board;

/// The timers that capture every eighth edge of an oscillator inside the chip: TIM5 of the watchdog's, TIM16 of the HSI divided by 16.
/// TIM16 has 16 bits.
fn timers() -> [&'static RegisterBlock; 2] {
    // SAFETY: both timers always exist, have the same registers up to TISEL, and belong to this file.
    unsafe { [&*pac::TIM5::ptr(), &*pac::TIM16::ptr().cast()] }
}

/// Starts the counter, and the captures of both oscillators.
///
/// # Errors
/// A timer has no clock.
pub fn start(timer: pac::TIM5, rcc: &mut Rcc, debug: &pac::DBGMCU) -> Result<(), StartError> {
    clock_on!(rcc.apb2enr(), tim16en, "TIM16")?;
    clock_on!(rcc.apb1enr1(), tim5en, "TIM5")?;
    // A debugger may have set the bit, and only a power cycle clears it.
    debug.apb1l_fz().modify(|_, w| w.dbg_tim5_stop().clear_bit());
    timer.psc().write(|w| w.psc().set(0));
    timer.arr().write(|w| w.arr().set(u32::MAX));
    timer.egr().write(|w| w.ug().update());
    rcc.csr().modify(|_, w| w.lsion().on());
    // MCO goes to the timer alone: its pin is a gate. The HSI is on after a reset, and stays on.
    rcc.cfgr().modify(|_, w| w.mcopre().div16().mcosel().hsi());
    // Input 1 of TIM5 is the LSI, input 2 of TIM16 is MCO (RM0440, TIM5_TISEL and TIM16_TISEL).
    for (timer, input) in timers().into_iter().zip([1, 2]) {
        // SAFETY: four bits, an existing input.
        timer.tisel().write(|w| unsafe { w.ti1sel().bits(input) });
        timer.ccmr1_input().write(|w| w.cc1s().ti1().ic1psc().eight_events());
        timer.ccer().write(|w| w.cc1e().set_bit());
        timer.cr1().write(|w| w.cen().enabled());
    }
    Ok(())
}

/// Core clocks since the start, wrapping; 0 before it.
#[inline] // into the control interrupt
pub fn now() -> u32 {
    // SAFETY: TIM5 always exists, and reading its counter changes nothing. Its clock is on after `start`; before, the read gives 0.
    unsafe { &*pac::TIM5::ptr() }.cnt().read().bits()
}

/// Core clocks from one capture of LSI and of HSI to the next; `None` if an oscillator stands still. The control interrupt may hide a
/// capture of the HSI, so that is tried again.
pub fn captured() -> Option<(u32, u32)> {
    let [lsi, hsi] = timers();
    let hsi = (0..4).find_map(|_| between_captures(hsi, board::HSI_TIMEOUT_US))?;
    Some((between_captures(lsi, board::LSI_TIMEOUT_US)?, hsi & 0xffff))
}

/// Core clocks from one capture to the next; `None` if none comes in this time, or one was missed.
fn between_captures(timer: &RegisterBlock, timeout_us: u32) -> Option<u32> {
    let began = now();
    let capture = || {
        while !timer.sr().read().cc1if().bit() {
            if now().wrapping_sub(began) > timeout_us * board::CYCLES_PER_US {
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
