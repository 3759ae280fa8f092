//! Runs the core or lets it sleep, and takes it into exceptions and back.

use anyhow::{Context, Result, bail, ensure};

use super::{Board, CONTROL_INTERRUPT, rom};
use stm32g4_unicorn::cpu::{Register, Stop};
use stm32g4_unicorn::{memory, scs};

impl Board {
    /// Takes the exception that is due.
    pub(super) fn exceptions(&mut self) -> Result<()> {
        let [primask, basepri] = [Register::PRIMASK, Register::BASEPRI].map(|r| self.cpu.get(r));
        let Some(exception) = self.cpu.chip().scs.due(primask, basepri) else { return Ok(()) };
        self.enter(exception)
    }

    fn enter(&mut self, exception: u16) -> Result<()> {
        self.progress.sleeping = false;
        if exception == CONTROL_INTERRUPT {
            self.begin_control();
            self.remember();
        }
        let vector = self.cpu.chip().scs.vector(exception);
        let handler = self.cpu.word(vector).context("no vector")?;
        self.cpu.chip_mut().scs.begin(exception);
        let stacked = self.cpu.enter(exception, handler & !1);
        if exception == CONTROL_INTERRUPT && self.poison.is_some() {
            self.cpu.spoil_float();
        }
        if !stacked && exception != scs::HARD_FAULT {
            // The stack is at its end: the frame is lost, and a fault is taken instead.
            self.hard_fault(1 << 12, None)?;
        }
        Ok(())
    }

    fn hard_fault(&mut self, cfsr: u32, address: Option<u32>) -> Result<()> {
        let pc = self.cpu.get(Register::PC);
        let chip = self.cpu.chip_mut();
        if chip.scs.running() < 0 {
            let place = || self.image.location(pc);
            ensure!(chip.forgiving, "lock-up: a fault in a fault handler at {}", place());
            // The core is locked up until a reset.
            chip.lock_up();
            self.progress.hung = true;
            return Ok(());
        }
        chip.scs.cfsr |= cfsr;
        chip.scs.hfsr |= 1 << 30;
        if let Some(address) = address {
            chip.scs.write(0xe000_ed38, address, chip.now);
            chip.scs.cfsr |= 1 << 15;
        }
        self.enter(scs::HARD_FAULT)
    }

    /// Runs the core, or lets time pass if it sleeps.
    pub(super) fn go(&mut self, end: u64) -> Result<()> {
        let chip = self.cpu.chip_mut();
        chip.deadline = chip.next_event().min(end);
        if chip.stalled_until > chip.now {
            chip.now = chip.now.max(chip.deadline.min(chip.stalled_until));
            return Ok(());
        }
        if self.progress.hung || self.progress.sleeping || chip.is_halted() || chip.browned_out() {
            if self.progress.sleeping && !chip.is_halted() && chip.scs.wakes() {
                self.progress.sleeping = false;
                return Ok(());
            }
            let before = chip.now;
            chip.now = chip.now.max(chip.deadline);
            if self.progress.sleeping && !chip.is_halted() {
                chip.sleep(chip.now - before);
            }
            return Ok(());
        }
        if chip.attention || chip.reset.is_some() {
            return Ok(());
        }
        // A pending exception is taken at the instruction that lifts its mask, so the core stops at every instruction.
        if chip.scs.wakes() {
            chip.deadline = chip.now + 1;
        }
        if let Some(at) = self.progress.preempt_at {
            chip.deadline =
                chip.deadline.min(chip.now + at.saturating_sub(chip.instructions).max(1));
        }
        match self.cpu.run() {
            Stop::Asked => {}
            Stop::Wait if rom::is_inside(self.cpu.get(Register::PC)) => self.enter_loader()?,
            Stop::Wait => self.progress.sleeping = true,
            Stop::Return(exc_return) => self.leave(exc_return)?,
            Stop::Access(address) if memory::is_reserved(address) || self.cpu.chip().forgiving => {
                self.hard_fault(1 << 9, Some(address))?;
            }
            Stop::Denied(address) => {
                // MMFAR, MMARVALID and DACCVIOL.
                let chip = self.cpu.chip_mut();
                chip.scs.write(0xe000_ed34, address, chip.now);
                self.hard_fault(1 << 7 | 1 << 1, None)?;
            }
            Stop::Instruction => self.hard_fault(1 << 16, None)?,
            Stop::Access(address) => {
                let place = self.image.location(self.cpu.chip().at);
                bail!("access to {address:#010x} at {place}");
            }
        }
        Ok(())
    }

    fn leave(&mut self, exc_return: u32) -> Result<()> {
        let ended = self.cpu.chip_mut().scs.end();
        if ended == Some(CONTROL_INTERRUPT) {
            self.end_control();
        }
        if ended.is_none() || !self.cpu.leave(exc_return) {
            self.hard_fault(1 << 11, None)?;
        } else if ended == Some(CONTROL_INTERRUPT) {
            self.compare_with_before()?;
        }
        Ok(())
    }
}
