//! The power stage: TIM1 generates the six gate signals, with dead time and break input.
//!
//! The counter runs up to its top and down to 0 once per pulse. A high side is on while the counter is below the compare value of its
//! leg, so all low sides are on around the top. At the top, once per control period of one to three pulses, the currents are sampled, and
//! the timer takes over the compare values written during the control period before: sample `k` acts in period `k + 1`.

use cortex_m::asm;
use drive_core::Compare;
use stm32g4xx_hal::pac;
use stm32g4xx_hal::rcc::Rcc;

use super::clocks::clock_on;
use super::{StartError, dc_link, pins};
use crate::board;
use crate::boards::{Level, SELECTED, pin};

/// UIF, BIF and SBIF of TIM1_SR.
const EVENTS: u32 = 1 | 1 << 7 | 1 << 13;

/// Events of the timer.
#[derive(Clone, Copy)]
pub struct TimerEvents {
    /// It has taken over compare values since the last call.
    pub updated: bool,
    /// The power stage, the comparator or a fault inside the chip has pulled the break since the last call, or still pulls it; or the
    /// outputs are off although they should be on, whatever switched them off.
    pub pulled: bool,
}

/// The timer of the power stage.
pub struct Pwm {
    timer: pac::TIM1,
    on: bool,
    /// [`ARMED`] if a start was taken since the drive was off. It is a second condition beside the state of the drive, in a word that a
    /// few flipped bits do not turn into the other value.
    armed: u32,
}

/// The outputs may be switched on.
const ARMED: u32 = 0x3c96_a5c3;
const DISARMED: u32 = !ARMED;

impl Pwm {
    /// Sets up the timer, with all six switches off and the counter at rest. The pins of the gates stay as after a reset until
    /// [`connect_gates`].
    ///
    /// # Errors
    /// The timer has no clock; dead time, polarity, break or lock do not read back as they were written; the address of its break
    /// register is not [`board::TIM1_BDTR`], which the fault handler writes.
    pub fn new(
        timer: pac::TIM1,
        rcc: &mut Rcc,
        debug: &pac::DBGMCU,
        system: &pac::SYSCFG,
        settings: &board::Timer,
    ) -> Result<Self, StartError> {
        if timer.bdtr().as_ptr() as u32 != board::TIM1_BDTR {
            return Err("TIM1 is not where the fault handler expects it");
        }
        clock_on!(rcc.apb2enr(), tim1en, "TIM1")?;
        // Halted by a debugger, the counter stops and the outputs go off. The watchdog runs on and resets the chip, so they
        // do not come back with the core.
        debug.apb2_fz().modify(|_, w| w.dbg_tim1_stop().set_bit());

        // Undivided clock; up and down between 0 and the top, so half a pulse's period each way.
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(u32::from(settings.top())));

        // a, b, c: on below the compare value (PWM mode 1), and that value preloaded.
        timer
            .ccmr1_output()
            .write(|w| w.oc1m().pwm_mode1().oc1pe().enabled().oc2m().pwm_mode1().oc2pe().enabled());
        // Channels 4 and 6 have no pins. The signal of channel 4 is high above its compare value (PWM mode 2), the signal of channel 6
        // below its own (PWM mode 1). They rise before the top and before 0, and start the conversions there.
        timer
            .ccmr2_output()
            .write(|w| w.oc3m().pwm_mode1().oc3pe().enabled().oc4m().pwm_mode2().oc4pe().enabled());
        for leg in 0..3 {
            timer.ccr(leg).write(|w| w.ccr().set(0));
        }
        timer.ccr(3).write(|w| w.ccr().set(u32::from(board::SAMPLE_AT)));
        timer.ccmr3_output().write(|w| w.oc6m().pwm_mode1());
        timer.ccr6().write(|w| w.ccr().set(board::UPPER_SAMPLE_AT));
        let (high, low) = (SELECTED.high.on_at.value, SELECTED.low.on_at.value);
        // Off is the level opposite to the one that switches on, with the timer enabled or not.
        let (high_low_active, low_low_active) = (high == Level::Low, low == Level::Low);
        timer.cr2().write(|w| {
            for leg in 0..3 {
                w.ois(leg).bit(high_low_active).oisn(leg).bit(low_low_active);
            }
            // SAFETY: four bits and three. Trigger output 2 is the signal of channel 6; trigger output 1 is channel 4 or the update
            // event.
            unsafe { w.mms2().bits(9).mms().bits(settings.trigger_output()) }
        });
        // Both outputs of the legs.
        timer.ccer().write(|w| {
            for leg in 0..3 {
                w.cce(leg).set_bit().ccne(leg).set_bit();
                w.ccp(leg).bit(high_low_active).ccnp(leg).bit(low_low_active);
            }
            w
        });

        // Further break sources, until the next reset: lock-up of the core, supply voltage, and errors of the flash that cannot be
        // corrected. (Not the parity of the RAM, which the factory's option bytes leave off.) The stored pages, which a power failure may
        // have torn, have been read before.
        clock_on!(rcc.apb2enr(), syscfgen, "SYSCFG")?;
        system.cfgr2().modify(|_, w| w.cll().set_bit().pvdl().set_bit().eccl().set_bit());
        // The control code has been copied: nothing writes the CCM any more.
        // SAFETY: each bit write-protects a page of it.
        system.swpr().write(|w| unsafe { w.bits(u32::MAX) });

        // The break inputs: the fault output of the power stage, and the comparator of the dc link, which trips high. One OR gate
        // combines them, so each must be low after its own polarity in normal operation, and the break itself is active high (BKP below).
        let trips_at_low = SELECTED.fault.trips_at.value == Level::Low;
        timer.af1().write(|w| {
            w.bkine().set_bit().bkinp().bit(trips_at_low);
            w.bkcmp1e().bit(board::COMPARATOR.0 == 0).bkcmp3e().bit(board::COMPARATOR.0 == 1)
        });
        // One write for all, including the lock, which counts from the first write after a reset (`stm32g4xx_ll_tim.h`). It keeps dead
        // time, polarity, break, idle level and output mode until the next reset.
        timer.bdtr().write(|w| {
            w.dtg().set(settings.dead_time_code);
            // Off means driven to the idle level: not floating.
            w.ossi().idle_level().ossr().idle_level();
            // Only software switches the outputs on again.
            w.bke().enabled().bkp().active_high().aoe().manual();
            // SAFETY: BKF is four bits wide; every value is one of the filters.
            unsafe { w.bkf().bits(board::BREAK_FILTER) };
            w.lock().level3().moe().disabled_idle()
        });
        let locked = timer.bdtr().read();
        if locked.dtg().bits() != settings.dead_time_code
            || locked.lock().bits() != 3
            || !(locked.ossi().bit() && locked.ossr().bit() && locked.bke().bit())
            || locked.aoe().bit()
            || locked.bkf().bits() != board::BREAK_FILTER
        {
            return Err("dead time, polarity, break or lock of TIM1 do not read back");
        }

        // Loads all preloaded registers. The repetition counter is loaded with 0 first, so that the first update comes when the counter
        // first reaches the top. After that an update comes once per control period, always at the top.
        timer.rcr().write(|w| w.rep().set(0));
        // See board::DEAD_TIME_CLOCKS.
        timer.cr1().write(|w| w.arpe().enabled().cms().center_aligned1().ckd().div2());
        timer.egr().write(|w| w.ug().update());
        timer.rcr().write(|w| w.rep().set(settings.updates_left_out()));

        // Pulled to the level that trips, so that a broken wire trips as well.
        let fault = SELECTED.fault;
        pins::alternate(fault.pin, fault.pin.function(pin::TIM1_BKIN), Some(fault.trips_at.value));

        Ok(Self { timer, on: false, armed: DISARMED })
    }

    /// Whether a break was flagged since the last call; clears it. For the self-test, with the outputs off.
    pub fn take_break(&mut self) -> bool {
        let broken = self.timer.sr().read().bif().bit();
        self.timer.sr().write(|w| w.bif().clear());
        broken
    }

    /// Starts the counter and checks that the compare values are taken over at the top.
    ///
    /// # Errors
    /// The counter does not run, or takes the compare values over elsewhere.
    pub fn start(&mut self) -> Result<(), StartError> {
        self.timer.sr().write(|w| w.uif().clear().bif().clear());
        self.timer.cr1().modify(|_, w| w.cen().enabled());
        // The first update comes half a pulse's period later; a whole control period is time enough.
        for _ in 0..2 * u32::from(board::PWM_TOP) / 16 {
            if self.updated() {
                let (count, top) = (self.timer.cnt().read().cnt(), self.timer.arr().read().arr());
                let near_the_top = 2 * u32::from(count.bits()) > top.bits();
                return if near_the_top { Ok(()) } else { Err("TIM1 does not run in step") };
            }
            asm::delay(16);
        }
        Err("TIM1 does not run in step")
    }

    /// Lets the outputs be switched on: a start was taken.
    pub fn arm(&mut self) {
        self.armed = ARMED;
    }

    /// Keeps the outputs off until the next [`arm`](Self::arm): the drive is off.
    pub fn disarm(&mut self) {
        self.armed = DISARMED;
    }

    /// Applies the output of the drive: compare values for the next period, outputs on or off now. Returns `false`, and the outputs stay
    /// off, if the drive wants its outputs on although no start was taken: then its state has a flipped bit.
    ///
    /// Until the first compare values are taken over, the initial zeros apply: low sides on.
    #[inline] // into the control interrupt
    pub fn apply(&mut self, compare: Compare) -> bool {
        if !compare.enabled {
            self.trip();
        }
        self.timer.ccr1().write(|w| w.ccr().set(u32::from(compare.a)));
        self.timer.ccr2().write(|w| w.ccr().set(u32::from(compare.b)));
        self.timer.ccr3().write(|w| w.ccr().set(u32::from(compare.c)));
        // Written once, when the drive switches on: if it were written in every period, it would undo a break since the sample.
        if compare.enabled && !self.on {
            if self.armed != ARMED {
                return false;
            }
            self.timer.bdtr().modify(|_, w| w.moe().enabled());
            self.on = true;
        }
        true
    }

    /// Switches all six switches off, now.
    pub fn trip(&mut self) {
        self.timer.bdtr().modify(|_, w| w.moe().disabled_idle());
        self.on = false;
    }

    /// The events since the last call; clears them.
    #[inline] // into the control interrupt
    pub fn take_events(&mut self) -> TimerEvents {
        let status = self.timer.sr().read();
        let (updated, broken) = (status.uif().bit(), status.bif().bit() || status.sbif().bit());
        // Clears only the flags that were read: a break since then stays for the next call. (Writing 1 leaves a flag as it is.) While the
        // break input is low the flag is set again.
        // SAFETY: flags of the register itself.
        self.timer.sr().write(|w| unsafe { w.bits(!(status.bits() & EVENTS)) });
        let lost = self.on && !self.timer.bdtr().read().moe().bit();
        TimerEvents { updated, pulled: broken || lost }
    }

    /// Ticks since the counter, counting down, was at [`board::PWM_TOP`], or would have been if its top were there. Half a control period
    /// or more while it counts up.
    #[inline] // into the control interrupt
    pub fn since_top(&self) -> u32 {
        let count = self.timer.cnt().read().cnt().bits();
        if self.timer.cr1().read().dir().is_down() {
            u32::from(board::PWM_TOP.saturating_sub(count))
        } else {
            u32::from(board::PWM_TOP) + u32::from(count)
        }
    }

    /// Whether the timer has taken over compare values since the last call of [`take_events`](Self::take_events).
    #[inline] // into the control interrupt
    pub fn updated(&self) -> bool {
        self.timer.sr().read().uif().bit_is_set()
    }
}

/// Connects the pins of the gates with the timer, which drives them off. Only on the board that the image is for: on another board, the
/// level that is off here may switch a gate on.
pub fn connect_gates() {
    // The resistors hold the gates off as well, should the timer ever release the pins.
    let off = |on_at: Level| if on_at == Level::Low { Level::High } else { Level::Low };
    let (high, low) = (SELECTED.high.on_at.value, SELECTED.low.on_at.value);
    let gates = SELECTED.high.pins.into_iter().zip(SELECTED.low.pins);
    for ((high_pin, low_pin), (positive, negative)) in gates.zip(pin::TIM1_LEGS) {
        pins::alternate(high_pin, high_pin.function(positive), Some(off(high)));
        pins::alternate(low_pin, low_pin.function(negative), Some(off(low)));
    }
}

/// Switches all six switches, chopper and relay off, from any context: for handlers that do not return.
pub fn outputs_off() {
    // SAFETY: TIM1 always exists. This function may interrupt the timer's owner anywhere; it only clears MOE, and nothing else runs after
    // it.
    let timer = unsafe { &*pac::TIM1::ptr() };
    timer.bdtr().modify(|_, w| w.moe().disabled_idle());
    dc_link::outputs_off();
}
