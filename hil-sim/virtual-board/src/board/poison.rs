//! A check that control interrupts leave the preempted code intact: registers, stack, and the floating-point
//! registers, which are poisoned as the interrupt begins, so that a register that is not restored shows.

use anyhow::{Result, bail};

use super::Board;
use crate::cpu::Register;
use crate::memory;

/// The state of the core before a control interrupt.
struct Preempted {
    registers: Vec<u64>,
    sp: u32,
    stack: Vec<u8>,
}

/// The watch over control interrupts.
#[derive(Default)]
pub struct Poison {
    top: u32,
    before: Option<Preempted>,
    /// Control interrupts that left everything as it was.
    pub intact: u64,
    /// Of these, in code that uses floating point.
    pub in_floating_point: u64,
}

impl Poison {
    /// For a stack that begins at this address.
    pub fn new(top: u32) -> Self {
        Self { top, ..Self::default() }
    }
}

impl Board {
    fn stack_above(&self, sp: u32, top: u32) -> Vec<u8> {
        let mut stack = vec![0; top.saturating_sub(sp.max(memory::RAM)) as usize];
        self.cpu.read(sp, &mut stack);
        stack
    }

    /// Remembers the state before a control interrupt.
    pub(super) fn remember(&mut self) {
        let Some(mut poison) = self.poison.take() else { return };
        let sp = self.cpu.get(Register::SP);
        let stack = self.stack_above(sp, poison.top);
        poison.before = Some(Preempted { registers: self.cpu.registers(), sp, stack });
        self.poison = Some(poison);
    }

    /// Poisons the floating-point registers as it begins.
    pub(super) fn spoil(&mut self) {
        if self.poison.is_some() {
            self.cpu.spoil_float();
        }
    }

    /// Compares the state after a control interrupt with that before it.
    ///
    /// # Errors
    /// The state differs.
    pub(super) fn compare_with_before(&mut self) -> Result<()> {
        let Some(poison) = &mut self.poison else { return Ok(()) };
        let (top, Some(before)) = (poison.top, poison.before.take()) else { return Ok(()) };
        let after = self.cpu.registers();
        if after != before.registers || self.stack_above(before.sp, top) != before.stack {
            let at = self.image.location(self.cpu.get(Register::PC));
            bail!(
                "a control interrupt changed the code it preempted at {at}: {:x?} became {after:x?}",
                before.registers
            );
        }
        if let Some(poison) = &mut self.poison {
            poison.intact += 1;
            poison.in_floating_point += u64::from(self.cpu.uses_float());
        }
        Ok(())
    }
}
