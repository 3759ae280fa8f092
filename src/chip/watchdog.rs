//! The independent watchdog: resets the chip when it is not fed in time. Once started, only a reset stops it.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::asm;
use stm32g4xx_hal::pac::{DBGMCU, IWDG};

use super::{pwm, stop, time};
use crate::board;
use crate::monitor::record::Reason;
use crate::monitor::watchdog::{FeedRule, Verdict};

/// Keys of IWDG_KR: start the watchdog, unlock its registers, reload it.
const START: u16 = 0xcccc;
const UNLOCK: u16 = 0x5555;
const RELOAD: u16 = 0xaaaa;

/// The watchdog, and the rule by which it is fed.
pub struct Watchdog {
    timer: IWDG,
    debug: DBGMCU,
    /// Control periods since the start, wrapping.
    periods: &'static AtomicU32,
    rule: FeedRule,
}

/// The watchdog, if it runs.
pub type Guard = Option<Watchdog>;

/// Does long `work` with the time of the watchdog extended to ten seconds, and restarts the rule after it: for work with the outputs off
/// that ends before they can be switched on. If the flash has one bank, the core and the control with it wait while the flash is written.
pub fn extended<R>(guard: &mut Guard, work: impl FnOnce() -> R) -> R {
    let Some(watchdog) = guard else { return work() };
    watchdog.set(board::WATCHDOG_LONG_PRESCALER, board::WATCHDOG_LONG_RELOAD);
    let result = work();
    watchdog.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
    watchdog.rule.restart(time::now(), watchdog.periods.load(Ordering::Relaxed));
    result
}

impl Watchdog {
    /// Starts it, with [`board::WATCHDOG_US`], over a control interrupt that counts these periods.
    pub fn start(timer: IWDG, debug: DBGMCU, periods: &'static AtomicU32) -> Self {
        let rule = FeedRule::new(time::now(), periods.load(Ordering::Relaxed));
        let mut watchdog = Self { timer, debug, periods, rule };
        watchdog.run_in_halts();
        watchdog.key(START);
        watchdog.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
        watchdog
    }

    /// Lets the watchdogs and the time base run on while a debugger halts the core: a halt ends in a reset, so the power stage stays off
    /// after it. Repeated in each pass of the main loop, because OpenOCD and ST's server stop the watchdogs when they attach
    /// (`stm32g4x.cfg`: DBGMCU_APB1_FZR1), and the bits survive a reset.
    fn run_in_halts(&mut self) {
        self.debug.apb1l_fz().modify(|_, w| {
            w.dbg_iwdg_stop().clear_bit().dbg_wwdg_stop().clear_bit().dbg_tim5_stop().clear_bit()
        });
    }

    /// Feeds it if the rule allows it; `missed` is whether a deadline was ever missed. Called in each pass of the main loop.
    pub fn feed(&mut self, missed: bool) {
        self.run_in_halts();
        let periods = self.periods.load(Ordering::Relaxed);
        match self.rule.judge(time::now(), periods, missed) {
            Verdict::Wait => {}
            Verdict::Feed => self.key(RELOAD),
            // The watchdog is about to reset the chip. The main loop itself works, and the console answers until then.
            Verdict::Refuse { periods, cycles } => {
                pwm::outputs_off();
                stop::keep(Reason::NotFed, [periods, cycles, u32::from(missed), 0]);
            }
        }
    }

    fn key(&mut self, key: u16) {
        // SAFETY: the three keys of the reference manual.
        self.timer.kr().write(|w| unsafe { w.bits(key) });
    }

    /// Waits until the registers have taken an earlier change: six of the watchdog's clocks after the prescaler then in force. The wait
    /// is limited in case its clock does not run.
    fn wait(&mut self) {
        for _ in 0..board::WATCHDOG_SET_US {
            if self.timer.sr().read().bits() == 0 {
                break;
            }
            self.key(RELOAD);
            asm::delay(board::CYCLES_PER_US);
        }
    }

    fn set(&mut self, prescaler: u8, reload: u16) {
        // A write while they are busy could be lost.
        self.wait();
        self.key(UNLOCK);
        // SAFETY: three bits and twelve bits; `board` keeps both inside.
        unsafe {
            self.timer.pr().write(|w| w.bits(u16::from(prescaler)));
            self.timer.rlr().write(|w| w.bits(reload));
        }
        self.wait();
        self.key(RELOAD);
    }
}
