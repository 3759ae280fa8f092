//! The independent watchdog: resets the chip when it is not fed in time. Once started, only a reset stops it.

use cortex_m::asm;
use stm32g4xx_hal::pac::{DBGMCU, IWDG};

use crate::board;

/// Keys of IWDG_KR: start the watchdog, unlock its registers, reload it.
const START: u16 = 0xcccc;
const UNLOCK: u16 = 0x5555;
const RELOAD: u16 = 0xaaaa;

/// The watchdog.
pub struct Watchdog {
    timer: IWDG,
    debug: DBGMCU,
}

impl Watchdog {
    /// Starts it, with [`board::WATCHDOG_US`].
    pub fn start(timer: IWDG, debug: DBGMCU) -> Self {
        let mut watchdog = Self { timer, debug };
        watchdog.run_in_halts();
        watchdog.key(START);
        watchdog.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
        watchdog
    }

    /// Lets the watchdogs and the time base run on while a debugger halts the core: a halt ends in a reset, so the power stage stays off
    /// after it. Called in each pass of the main loop, because OpenOCD and ST's server stop the watchdogs when they attach
    /// (`stm32g4x.cfg`: DBGMCU_APB1_FZR1), and the bits survive a reset.
    pub fn run_in_halts(&mut self) {
        self.debug.apb1l_fz().modify(|_, w| {
            w.dbg_iwdg_stop().clear_bit().dbg_wwdg_stop().clear_bit().dbg_tim5_stop().clear_bit()
        });
    }

    /// Feeds it.
    pub fn feed(&mut self) {
        self.key(RELOAD);
    }

    /// Does long `work` with the watchdog's time extended to ten seconds: for work with the outputs off that ends before they can be
    /// switched on.
    pub fn extended<R>(&mut self, work: impl FnOnce() -> R) -> R {
        self.set(board::WATCHDOG_LONG_PRESCALER, board::WATCHDOG_LONG_RELOAD);
        let result = work();
        self.set(board::WATCHDOG_PRESCALER, board::WATCHDOG_RELOAD);
        result
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
