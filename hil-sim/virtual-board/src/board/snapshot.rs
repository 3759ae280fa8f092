//! Snapshots of a board: a start takes seconds, going back to a snapshot takes less than a millisecond.

use anyhow::{Result, anyhow};
use hil_sim::plant::Plant;

use super::{Board, Chip, Progress, motor::Connection};
use stm32g4_unicorn::{cpu::CoreState, periph::Reset};

/// Everything that changes on a board.
pub struct Snapshot {
    core: CoreState,
    chip: Chip,
    plant: Plant,
    connection: Connection,
    sleeping: bool,
    resets: Vec<(u64, Reset)>,
}

impl Board {
    /// Stores the present state of the board, outside an interrupt.
    ///
    /// # Errors
    /// The core cannot be stored, or the log cannot be decoded.
    pub fn keep(&mut self) -> Result<Snapshot> {
        // The log so far belongs to the time before.
        self.take_log()?;
        self.take_console();
        Ok(Snapshot {
            core: self.cpu.keep().map_err(|e| anyhow!("emulator: {e:?}"))?,
            chip: self.cpu.chip().clone(),
            plant: self.plant.clone(),
            connection: self.connection.clone(),
            sleeping: self.progress.sleeping,
            resets: self.resets.clone(),
        })
    }

    /// Goes back to a snapshot of this board.
    ///
    /// # Errors
    /// The core cannot go back.
    pub fn go_back(&mut self, to: &Snapshot) -> Result<()> {
        self.cpu.go_back(&to.core).map_err(|e| anyhow!("emulator: {e:?}"))?;
        let forgiving = self.cpu.chip().forgiving;
        *self.cpu.chip_mut() = to.chip.clone();
        self.cpu.chip_mut().forgiving = forgiving;
        self.cpu.chip_mut().rules.collecting |= forgiving;
        self.plant = to.plant.clone();
        self.connection = to.connection.clone();
        self.progress = Progress { sleeping: to.sleeping, ..Progress::default() };
        self.resets = to.resets.clone();
        self.disturb = None;
        self.went_off = None;
        self.short_pulses = 0;
        if let Some(log) = &mut self.log {
            log.forget();
        }
        Ok(())
    }
}
