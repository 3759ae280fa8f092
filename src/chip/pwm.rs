//! The power stage: TIM1 generates the six gate signals, with dead time and break input.
//!
//! The counter runs up to [`board::PWM_TOP`] and down to 0 once per period. A high side is on while
//! the counter is below the compare value of its leg, so all low sides are on around the top. There
//! the currents are sampled, and there the timer takes over the compare values written during the
//! period before: sample `k` acts in period `k + 1`.

use cortex_m::asm;
use drive_core::Compare;
use stm32g4xx_hal::gpio::{Analog, Input, PA6, PA7, PA8, PA9, PA10, PB0, PB1, Pull};
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use induction_drive::board;

/// The pins of the power stage, as they are after reset.
pub struct Pins {
    /// Gates of the high sides a, b, c.
    pub high: (PA8<Analog>, PA9<Analog>, PA10<Analog>),
    /// Gates of the low sides a, b, c.
    pub low: (PA7<Analog>, PB0<Analog>, PB1<Analog>),
    /// Fault output of the power stage.
    pub fault: PA6<Analog>,
}

/// Reason why the timer was not set up or started.
#[derive(Clone, Copy, defmt::Format)]
pub enum PwmError {
    /// The address of its break register is not [`board::TIM1_BDTR`], which the fault handler writes.
    WrongAddress,
    /// It does not take over its compare values where all low sides are on, or does not run.
    NotInStep,
}

/// Events of the timer.
#[derive(Clone, Copy)]
pub struct TimerEvents {
    /// It has taken over compare values since the last call.
    pub updated: bool,
    /// The power stage, the comparator or a fault inside the chip has pulled the break since the last
    /// call, or still pulls it.
    pub pulled: bool,
}

/// The timer of the power stage.
pub struct Pwm {
    timer: pac::TIM1,
    on: bool,
}

impl Pwm {
    /// Sets up the timer, with all six switches off and the counter at rest.
    ///
    /// # Errors
    /// [`PwmError::WrongAddress`].
    pub fn new(
        timer: pac::TIM1,
        pins: Pins,
        rcc: &mut Rcc,
        debug: &pac::DBGMCU,
        system: &pac::SYSCFG,
        dead_time_code: u8,
    ) -> Result<Self, PwmError> {
        if timer.bdtr().as_ptr() as u32 != board::TIM1_BDTR {
            return Err(PwmError::WrongAddress);
        }
        rcc.apb2enr().modify(|_, w| w.tim1en().enabled());
        // Halted by a debugger, the counter stops and the outputs go off.
        debug.apb2_fz().modify(|_, w| w.dbg_tim1_stop().set_bit());

        // Undivided clock; up and down between 0 and the top, so half a period each way.
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(u32::from(board::PWM_TOP)));

        // a, b, c: on below the compare value (PWM mode 1), and that value preloaded.
        timer
            .ccmr1_output()
            .write(|w| w.oc1m().pwm_mode1().oc1pe().enabled().oc2m().pwm_mode1().oc2pe().enabled());
        // Channel 4 has no pin; its signal is high above its compare value (PWM mode 2) and starts
        // the conversions.
        timer
            .ccmr2_output()
            .write(|w| w.oc3m().pwm_mode1().oc3pe().enabled().oc4m().pwm_mode2().oc4pe().enabled());
        for leg in 0..3 {
            timer.ccr(leg).write(|w| w.ccr().set(0));
        }
        timer.ccr(3).write(|w| w.ccr().set(u32::from(board::SAMPLE_AT)));
        // SAFETY: MMS2 is four bits wide; 7 makes the signal of channel 4 the trigger output 2.
        timer.cr2().write(|w| unsafe { w.mms2().bits(7) });

        // Both outputs of the legs, active high.
        timer.ccer().write(|w| {
            w.cc1e().set_bit().cc1ne().set_bit();
            w.cc2e().set_bit().cc2ne().set_bit();
            w.cc3e().set_bit().cc3ne().set_bit()
        });

        // To the break as well, until the next reset: lock-up of the core, parity of the RAM, supply
        // voltage, and errors of the flash that cannot be corrected.
        rcc.apb2enr().modify(|_, w| w.syscfgen().enabled());
        system
            .cfgr2()
            .modify(|_, w| w.cll().set_bit().spl().set_bit().pvdl().set_bit().eccl().set_bit());

        // The break inputs: pin PA6, low trips, so inverted; the comparator of the dc link, high trips.
        // One OR gate combines them, so each must be low behind its own polarity in normal operation, and the break
        // itself is active high (BKP below).
        timer.af1().write(|w| w.bkine().set_bit().bkinp().set_bit().bkcmp1e().set_bit());
        timer.bdtr().write(|w| {
            w.dtg().set(dead_time_code);
            // Off means driven to the idle level, which is low (CR2.OISx = 0): not floating.
            w.ossi().idle_level().ossr().idle_level();
            // Only software switches the outputs on again.
            w.bke().enabled().bkp().active_high().aoe().manual();
            // SAFETY: BKF is four bits wide; every value is one of the filters.
            unsafe { w.bkf().bits(board::BREAK_FILTER) };
            w.moe().disabled_idle()
        });

        // Load all of it. The repetition counter is loaded with 0 first, so that the first update
        // comes when the counter first reaches the top; from there on every other one, always at
        // the top.
        timer.rcr().write(|w| w.rep().set(0));
        // See board::DEAD_TIME_CLOCKS.
        timer.cr1().write(|w| w.arpe().enabled().cms().center_aligned1().ckd().div2());
        timer.egr().write(|w| w.ug().update());
        timer.rcr().write(|w| w.rep().set(board::PWM_UPDATES_LEFT_OUT));

        // Locks dead time, polarity, break, idle level and output mode until the next reset.
        timer.bdtr().modify(|_, w| w.lock().level3());

        // The pins follow last: they are driven low. The resistors hold them low as well, should the timer ever
        // release them.
        let Pins { high, low, fault } = pins;
        high.0.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        high.1.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        high.2.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.0.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.1.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.2.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        // Pulled down, so that a broken wire trips. The power stage must pull it up (10 kOhm or less against the
        // 40 kOhm of the chip).
        Input::new(fault, Pull::Down).into_alternate::<{ board::PWM_AF }>();

        Ok(Self { timer, on: false })
    }

    /// Starts the counter and checks that the compare values are taken over at the top.
    ///
    /// # Errors
    /// [`PwmError::NotInStep`].
    pub fn start(&mut self) -> Result<(), PwmError> {
        self.timer.sr().write(|w| w.uif().clear().bif().clear());
        self.timer.cr1().modify(|_, w| w.cen().enabled());
        // The first update comes half a period later; a whole period is time enough.
        for _ in 0..2 * u32::from(board::PWM_TOP) / 16 {
            if self.updated() {
                let near_the_top = self.timer.cnt().read().cnt().bits() > board::PWM_TOP / 2;
                return if near_the_top { Ok(()) } else { Err(PwmError::NotInStep) };
            }
            asm::delay(16);
        }
        Err(PwmError::NotInStep)
    }

    /// Applies the output of the drive: compare values for the next period, outputs on or off now.
    ///
    /// Until the first compare values are taken over, the initial zeros hold: low sides on.
    pub fn apply(&mut self, compare: Compare) {
        if !compare.enabled {
            self.trip();
        }
        self.timer.ccr1().write(|w| w.ccr().set(u32::from(compare.a)));
        self.timer.ccr2().write(|w| w.ccr().set(u32::from(compare.b)));
        self.timer.ccr3().write(|w| w.ccr().set(u32::from(compare.c)));
        // Once, when the drive switches on: written in every period, it would undo a break since the sample.
        if compare.enabled && !self.on {
            self.timer.bdtr().modify(|_, w| w.moe().enabled());
            self.on = true;
        }
    }

    /// Switches all six switches off, now.
    pub fn trip(&mut self) {
        self.timer.bdtr().modify(|_, w| w.moe().disabled_idle());
        self.on = false;
    }

    /// The events since the last call; clears them.
    pub fn take_events(&mut self) -> TimerEvents {
        let status = self.timer.sr().read();
        let pulled = status.bif().bit_is_set() || status.sbif().bit_is_set();
        // The break stays set while its input is low.
        self.timer.sr().write(|w| w.uif().clear().bif().clear().sbif().clear());
        TimerEvents { updated: status.uif().bit_is_set(), pulled }
    }

    /// Ticks since the counter was at its top while it counts down; half a period or more while it counts up.
    pub fn since_top(&self) -> u32 {
        let count = self.timer.cnt().read().cnt().bits();
        if self.timer.cr1().read().dir().is_down() {
            u32::from(board::PWM_TOP.saturating_sub(count))
        } else {
            u32::from(board::PWM_TOP) + u32::from(count)
        }
    }

    /// Whether the timer has taken over compare values since the last call of [`take_events`](Self::take_events).
    pub fn updated(&self) -> bool {
        self.timer.sr().read().uif().bit_is_set()
    }
}

/// Switches all six switches off, from any context: for handlers that do not return.
pub fn outputs_off() {
    // SAFETY: TIM1 always exists. This may interrupt the owner of the timer anywhere; it only clears MOE, and nothing
    // else runs after it.
    let timer = unsafe { &*pac::TIM1::ptr() };
    timer.bdtr().modify(|_, w| w.moe().disabled_idle());
}
