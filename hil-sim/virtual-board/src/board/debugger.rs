//! Effects of a debugger at the debug port on the board.

use anyhow::Result;

use super::Board;
use stm32g4_unicorn::chip::TICKS_PER_S;
use stm32g4_unicorn::chip::debugger::{TIM5_STOP, WATCHDOG_STOPS};

/// A program at the debug port, with the peripherals of APB1 that it stops by DBGMCU while the core is halted. All of
/// them keep the port alive in low-power modes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Debugger {
    /// probe-rs.
    ProbeRs = 0,
    /// OpenOCD with `target/stm32g4x.cfg`, event `examine-end`: it stops both watchdogs while the core is halted.
    OpenOcd = WATCHDOG_STOPS,
    /// ST's server with its option that suspends the watchdogs; as the worst case it is assumed to stop TIM5 as well.
    StServer = WATCHDOG_STOPS | TIM5_STOP,
}

impl Debugger {
    /// All debuggers.
    pub const ALL: [Self; 3] = [Self::ProbeRs, Self::OpenOcd, Self::StServer];
}

impl Board {
    /// Attaches a debugger.
    pub fn attach(&mut self, debugger: Debugger) {
        self.chip().attach(debugger as u32);
    }

    /// Detaches the debugger, and clears the bits of low-power modes.
    pub fn detach(&mut self) {
        self.chip().detach();
    }

    /// Halts the core for some time, ms; [`Board::resume`] continues it.
    ///
    /// # Errors
    /// As [`Board::run_ticks`].
    pub fn halt(&mut self, ms: f64) -> Result<()> {
        self.chip().halt();
        self.run_ticks((ms * 1e-3 * TICKS_PER_S as f64) as u64)
    }

    /// Lets the core continue.
    pub fn resume(&mut self) {
        self.chip().resume();
    }
}
