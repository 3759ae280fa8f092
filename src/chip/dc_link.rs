//! Outputs for the dc link: brake chopper and precharge relay.
//!
//! TIM8 generates the chopper's pulses, one per control period (with 12 and 18 kHz one less in 2.4 s, because its period is fixed); the
//! relay is a plain output. A high level switches either on. A reset releases both pins, so external resistors pull them down
//! ([`Wiring`](crate::boards::Wiring)). The break of TIM8 switches the chopper off without software if the core locks up, or the
//! supply or the flash fails.

use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::{StartError, pins};
use crate::board::PERIOD_TICKS;
use crate::boards::pin::Pin;
use crate::boards::{Level, SELECTED, pin};

const CHOPPER: Pin = SELECTED.wiring.chopper;
const RELAY: Pin = SELECTED.wiring.relay;

/// Chopper and relay.
pub struct DcLink {
    timer: pac::TIM8,
}

impl DcLink {
    /// Switches both off, then connects them with their pins.
    ///
    /// # Errors
    /// The timer has no clock.
    pub fn new(timer: pac::TIM8, rcc: &mut Rcc, debug: &pac::DBGMCU) -> Result<Self, StartError> {
        clock_on!(rcc.apb2enr(), tim8en, "TIM8")?;
        // Halted by a debugger, the counter stops and the chopper goes off.
        debug.apb2_fz().modify(|_, w| w.dbg_tim8_stop().set_bit());
        timer.arr().write(|w| w.arr().set(PERIOD_TICKS - 1));
        // High below the compare value (PWM mode 1), which is preloaded.
        timer.ccmr1_output().write(|w| w.oc1m().pwm_mode1().oc1pe().enabled());
        timer.ccr1().write(|w| w.ccr().set(0));
        timer.ccer().write(|w| w.cce(0).set_bit());
        // No pin triggers its break, only faults inside the chip, which `Pwm::new` connects for all timers.
        timer.af1().write(|w| w.bkine().clear_bit());
        timer.bdtr().write(|w| {
            w.ossi().idle_level().bke().enabled().bkp().active_high().aoe().manual().moe().enabled()
        });
        timer.egr().write(|w| w.ug().update());
        timer.cr1().write(|w| w.arpe().enabled().cen().enabled());
        pins::alternate(CHOPPER, CHOPPER.function(pin::TIM8_CH1), Some(Level::Low));
        pins::output(RELAY, Level::Low);
        Ok(Self { timer })
    }

    /// Whether a break has taken the chopper off, whatever its duty.
    pub fn is_off(&self) -> bool {
        self.timer.bdtr().read().moe().bit_is_clear()
    }

    /// Lets the chopper switch again; without effect while the cause of the break lasts.
    pub fn restore(&mut self) {
        self.timer.bdtr().modify(|_, w| w.moe().enabled());
    }

    /// Sets the duty of the chopper, 0 to 1, from the next period on, and the relay.
    pub fn set(&mut self, duty: f32, relay: bool) {
        // The cast saturates.
        self.timer.ccr1().write(|w| w.ccr().set((duty * PERIOD_TICKS as f32) as u32));
        pins::set(RELAY, if relay { Level::High } else { Level::Low });
    }
}

/// Switches both off, from any context: for handlers that do not return.
pub fn outputs_off() {
    // SAFETY: TIM8 always exists. This function may interrupt the timer's owner anywhere; it only clears MOE. An owner that still runs
    // sets MOE again only with the drive off, at the duty zero.
    let timer = unsafe { &*pac::TIM8::ptr() };
    timer.bdtr().modify(|_, w| w.moe().disabled_idle());
    pins::set(RELAY, Level::Low);
}
