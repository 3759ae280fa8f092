//! A debugger at the debug port: it halts and continues the core, and sets and clears bits of DBGMCU.

use super::{Chip, Circuit, TICKS_PER_S};
use crate::periph::bits;
use crate::periph::plain::{DBG_APB1_FZ, DBG_APB2_FZ, DBG_CR};
use crate::rules::Rule;

// DBGMCU: the clock of the core runs on while it sleeps; the watchdogs and timers stop while the core is halted.
bits! { SLEEP = 0 }
bits! { pub(super) WWDG_STOP = 11, pub(super) IWDG_STOP = 12 }
bits! { TIM1_STOP = 11, TIM8_STOP = 13 }
/// DBGMCU: clocks run on in sleep, stop and standby.
const LOW_POWER: u32 = 7;
/// DBGMCU: TIM5 stops while the core is halted.
pub const TIM5_STOP: u32 = 1 << 3;
/// DBGMCU: both watchdogs stop while the core is halted.
pub const WATCHDOG_STOPS: u32 = IWDG_STOP | WWDG_STOP;

/// Time in which the program must switch off outputs that come back as the core continues, ticks: a third of a millisecond.
const NOTICED: u64 = TICKS_PER_S / 3000;

/// A halt in progress.
#[derive(Clone, Copy, Debug)]
pub struct Halt {
    since: u64,
    /// Whether the outputs were on.
    outputs: bool,
}

impl<C: Circuit> Chip<C> {
    /// Attaches a debugger, which keeps its port alive in low-power modes. While it halts the core, these peripherals of
    /// APB1 stop, as bits of DBGMCU.
    pub fn attach(&mut self, stops: u32) {
        for (register, bits) in [(DBG_CR, LOW_POWER), (DBG_APB1_FZ, stops)] {
            let old = self.debug.get(register);
            self.debug.write(register, old | bits);
        }
    }

    /// Lets the core continue and detaches the debugger, which clears the bits of low-power modes.
    pub fn detach(&mut self) {
        self.resume();
        let cr = self.debug.get(DBG_CR);
        self.debug.write(DBG_CR, cr & !LOW_POWER);
    }

    /// Halts the core. The peripherals that DBGMCU selects stop with it.
    pub fn halt(&mut self) {
        if self.halt.is_some() {
            return;
        }
        self.halt = Some(Halt { since: self.now, outputs: self.tim1.outputs_on() });
        if self.debug.get(DBG_APB2_FZ) & TIM1_STOP != 0 {
            self.tim1.freeze(self.now);
            self.follow_pins();
        }
        self.attention = true;
    }

    /// Whether a halt has stopped TIM8, which switches its output off.
    pub(super) fn stops_tim8(&self) -> bool {
        self.halt.is_some() && self.debug.get(DBG_APB2_FZ) & TIM8_STOP != 0
    }

    /// Whether a halt stops this peripheral of APB1.
    pub(super) fn stops(&self, bit: u32) -> bool {
        self.halt.is_some() && self.debug.get(DBG_APB1_FZ) & bit != 0
    }

    /// Lets the core continue.
    pub fn resume(&mut self) {
        let Some(Halt { since, .. }) = self.halt else { return };
        let stood = self.now - since;
        if self.stops(IWDG_STOP) {
            self.iwdg.delay(stood);
        }
        if self.stops(WWDG_STOP) {
            self.wwdg.delay(stood);
        }
        if self.stops(TIM5_STOP) {
            self.tim5.delay(stood);
        }
        let Some(halt) = self.halt.take() else { return };
        self.tim1.thaw(self.now);
        self.follow_pins();
        // The cycle counter does not count in debug state.
        self.scs.stand_still(stood);
        let back = halt.outputs && self.tim1.outputs_on();
        self.back_on = back.then_some(self.now + NOTICED);
        self.attention = true;
    }

    /// Checks outputs that came back with the core.
    pub(crate) fn check_outputs_back(&mut self) {
        if !self.tim1.outputs_on() {
            self.back_on = None;
        }
        if self.back_on.is_some_and(|at| at <= self.now) {
            self.back_on = None;
            self.rules.note(
                Rule::ResumedOutputs,
                "TIM1's outputs are on a third of a millisecond after a debugger halted the core and let it go",
            );
        }
    }

    /// Whether the core is halted.
    pub fn is_halted(&self) -> bool {
        self.halt.is_some()
    }

    /// Lets time pass while the core sleeps.
    pub fn sleep(&mut self, ticks: u64) {
        if self.debug.get(DBG_CR) & SLEEP == 0 {
            self.scs.stand_still(ticks);
        }
    }
}
