//! What a debugger at the debug port does to the board.

use anyhow::Result;

use super::Board;
use crate::chip::TICKS_PER_S;
use crate::chip::debugger::LOW_POWER;
use crate::periph::plain::DBG_CR;

impl Board {
    /// A debugger attaches: it keeps the debug port alive in low-power modes.
    pub fn attach(&mut self) {
        let debug = &mut self.chip().debug;
        let cr = debug.get(DBG_CR);
        debug.write(DBG_CR, cr | LOW_POWER);
    }

    /// It detaches, and clears what it has set.
    pub fn detach(&mut self) {
        self.resume();
        let debug = &mut self.chip().debug;
        let cr = debug.get(DBG_CR);
        debug.write(DBG_CR, cr & !LOW_POWER);
    }

    /// It halts the core for some time, ms; [`Board::resume`] lets it go on.
    ///
    /// # Errors
    /// As of [`Board::run_ticks`].
    pub fn halt(&mut self, ms: f64) -> Result<()> {
        self.chip().halt();
        self.run_ticks((ms * 1e-3 * TICKS_PER_S as f64) as u64)
    }

    /// It lets the core go on.
    pub fn resume(&mut self) {
        self.chip().resume();
    }
}
