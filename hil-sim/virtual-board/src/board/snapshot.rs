//! A board that can be gone back to: starting one takes seconds, going back less than a millisecond.

use anyhow::{Result, anyhow};
use hil_sim::plant::Plant;

use super::{Board, Compare, Sample};
use crate::chip::Chip;
use crate::cpu::Standing;
use crate::periph::Reset;

/// FirmwareSettings of a board that moves.
pub struct Snapshot {
    standing: Standing,
    chip: Chip,
    plant: Plant,
    plant_at: u64,
    applied: Compare,
    outputs: bool,
    sample: Sample,
    sleeping: bool,
    resets: Vec<(u64, Reset)>,
}

impl Board {
    /// Keeps the board as it is now, outside an interrupt.
    ///
    /// # Errors
    /// The core cannot be kept; the log cannot be decoded.
    pub fn keep(&mut self) -> Result<Snapshot> {
        // What is in the log is taken, so that none of it is seen twice.
        self.logged()?;
        self.heard();
        Ok(Snapshot {
            standing: self.cpu.keep().map_err(|e| anyhow!("emulator: {e:?}"))?,
            chip: self.cpu.chip().clone(),
            plant: self.plant.clone(),
            plant_at: self.plant_at,
            applied: self.applied,
            outputs: self.outputs,
            sample: self.sample,
            sleeping: self.sleeping,
            resets: self.resets.clone(),
        })
    }

    /// Goes back to what was kept of this board.
    ///
    /// # Errors
    /// The core cannot go back.
    pub fn go_back(&mut self, to: &Snapshot) -> Result<()> {
        self.cpu.go_back(&to.standing).map_err(|e| anyhow!("emulator: {e:?}"))?;
        let forgiving = self.cpu.chip().forgiving;
        *self.cpu.chip_mut() = to.chip.clone();
        self.cpu.chip_mut().forgiving = forgiving;
        self.plant = to.plant.clone();
        self.plant_at = to.plant_at;
        self.applied = to.applied;
        self.outputs = to.outputs;
        self.sample = to.sample;
        self.sleeping = to.sleeping;
        self.resets = to.resets.clone();
        self.hung = false;
        self.stalled_until = 0;
        self.entered = None;
        self.disturb = None;
        self.preempt_at = None;
        self.went_off = None;
        self.short_pulses = 0;
        self.periods.clear();
        self.lines.clear();
        self.log.forget();
        Ok(())
    }
}
