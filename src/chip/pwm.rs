//! The power stage: TIM1 makes the six gate signals, with dead time and break input.
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

/// The timer does not take over its compare values where all low sides are on, or does not run.
#[derive(Clone, Copy, defmt::Format)]
pub struct NotInStep;

/// What the timer has to tell.
#[derive(Clone, Copy)]
pub struct Events {
    /// It has taken over compare values since the last look.
    pub updated: bool,
    /// The power stage, the comparator or a fault inside the chip has pulled the break since the last look,
    /// or still pulls it.
    pub pulled: bool,
}

/// The timer of the power stage.
pub struct Pwm {
    timer: pac::TIM1,
    on: bool,
}

impl Pwm {
    /// Sets up the timer, with all six switches off and the counter at rest.
    pub fn new(
        timer: pac::TIM1,
        pins: Pins,
        rcc: &mut Rcc,
        debug: &pac::DBGMCU,
        system: &pac::SYSCFG,
        dead_time_code: u8,
    ) -> Self {
        // Both names of one register: see board.rs.
        assert!(timer.bdtr().as_ptr() as u32 == board::TIM1_BDTR);
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
        // All of them go through one OR gate, so behind their own polarity each must be low while all is
        // well, and the break itself is active high (BKP below).
        timer.af1().write(|w| w.bkine().set_bit().bkinp().set_bit().bkcmp1e().set_bit());
        timer.bdtr().write(|w| {
            w.dtg().set(dead_time_code);
            // Off means driven to the idle level, which is low (CR2.OISx = 0): not floating.
            w.ossi().idle_level().ossr().idle_level();
            // Nothing but software switches the outputs on again.
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

        // From here to the next reset nobody changes dead time, polarity, break, idle level or
        // output mode any more.
        timer.bdtr().modify(|_, w| w.lock().level3());

        // Only now the pins: they are driven low. The resistor holds them low as well, should the
        // timer ever let go.
        let Pins { high, low, fault } = pins;
        high.0.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        high.1.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        high.2.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.0.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.1.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        low.2.into_alternate::<{ board::PWM_AF }>().set_internal_resistor(Pull::Down);
        // Pulled down, so that a wire that came off trips. The power stage must pull it up (10 kOhm
        // or less against the 40 kOhm in here).
        Input::new(fault, Pull::Down).into_alternate::<{ board::PWM_AF }>();

        Self { timer, on: false }
    }

    /// Starts the counter and checks that the compare values are taken over at the top.
    pub fn start(&mut self) -> Result<(), NotInStep> {
        self.timer.sr().write(|w| w.uif().clear().bif().clear());
        self.timer.cr1().modify(|_, w| w.cen().enabled());
        // The first update comes half a period later; a whole period is time enough.
        for _ in 0..2 * u32::from(board::PWM_TOP) / 16 {
            if self.updated() {
                let near_the_top = self.timer.cnt().read().cnt().bits() > board::PWM_TOP / 2;
                return if near_the_top { Ok(()) } else { Err(NotInStep) };
            }
            asm::delay(16);
        }
        Err(NotInStep)
    }

    /// Does what the drive wants: compare values for the period after this one, outputs on or off
    /// now.
    ///
    /// Until the first compare values are taken over, the zeros from before hold: low sides on.
    #[inline(always)]
    pub fn apply(&mut self, compare: Compare) {
        if !compare.enabled {
            // First of all.
            self.trip();
        }
        self.timer.ccr1().write(|w| w.ccr().set(u32::from(compare.a)));
        self.timer.ccr2().write(|w| w.ccr().set(u32::from(compare.b)));
        self.timer.ccr3().write(|w| w.ccr().set(u32::from(compare.c)));
        // Once, when the drive switches on: written again in every period, it would undo a break
        // that came since the sample.
        if compare.enabled && !self.on {
            self.timer.bdtr().modify(|_, w| w.moe().enabled());
            self.on = true;
        }
    }

    /// All six switches off, now.
    #[inline(always)]
    pub fn trip(&mut self) {
        self.timer.bdtr().modify(|_, w| w.moe().disabled_idle());
        self.on = false;
    }

    /// What the timer has to tell; takes back what is only told once.
    #[inline(always)]
    pub fn look(&mut self) -> Events {
        let status = self.timer.sr().read();
        let pulled = status.bif().bit_is_set() || status.sbif().bit_is_set();
        // The break stays set while its input is low.
        self.timer.sr().write(|w| w.uif().clear().bif().clear().sbif().clear());
        Events { updated: status.uif().bit_is_set(), pulled }
    }

    /// Ticks since the counter was at its top, if it is on its way down; else as much as half a
    /// period, or more.
    #[inline(always)]
    pub fn since_top(&self) -> u32 {
        let count = self.timer.cnt().read().cnt().bits();
        if self.timer.cr1().read().dir().is_down() {
            u32::from(board::PWM_TOP.saturating_sub(count))
        } else {
            u32::from(board::PWM_TOP) + u32::from(count)
        }
    }

    /// Whether the timer has taken over compare values since the last look.
    #[inline(always)]
    pub fn updated(&self) -> bool {
        self.timer.sr().read().uif().bit_is_set()
    }
}

/// All six switches off, at once, from wherever: for handlers that do not return.
pub fn outputs_off() {
    // SAFETY: TIM1 exists for as long as the chip does. Whoever owns the timer may be interrupted
    // anywhere by this; it only ever takes MOE away, and after it nothing else runs.
    let timer = unsafe { &*pac::TIM1::ptr() };
    timer.bdtr().modify(|_, w| w.moe().disabled_idle());
}
