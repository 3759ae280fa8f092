//! A check that control interrupts leave the preempted code intact: registers, stack, and the floating-point registers.
//! The latter are poisoned as the interrupt begins, so that a register that is not restored becomes visible.

use anyhow::{Result, bail};

use super::Board;
use crate::{cpu::Register, memory};

/// The state of the core before a control interrupt.
#[derive(PartialEq)]
struct Preempted {
    registers: Vec<u64>,
    sp: u32,
    stack: Vec<u8>,
}

/// The check of the control interrupts.
#[derive(Default)]
pub struct Poison {
    top: u32,
    before: Option<Preempted>,
    /// Number of control interrupts that left everything unchanged.
    pub intact: u64,
    /// Number of these that preempted code with floating point.
    pub in_floating_point: u64,
}

impl Poison {
    /// Makes the check for a stack that begins at this address.
    pub fn new(top: u32) -> Self {
        Self { top, ..Self::default() }
    }
}

impl Board {
    /// Returns the state of the core, with the stack between two addresses.
    fn preempted(&self, sp: u32, top: u32) -> Preempted {
        let mut stack = vec![0; top.saturating_sub(sp.max(memory::RAM)) as usize];
        self.cpu.read(sp, &mut stack);
        Preempted { registers: self.cpu.registers(), sp, stack }
    }

    /// Stores the state before a control interrupt.
    pub(super) fn remember(&mut self) {
        let Some(mut poison) = self.poison.take() else { return };
        poison.before = Some(self.preempted(self.cpu.get(Register::SP), poison.top));
        self.poison = Some(poison);
    }

    /// Compares the state after a control interrupt with the state before it.
    ///
    /// # Errors
    /// The states differ.
    pub(super) fn compare_with_before(&mut self) -> Result<()> {
        let Some(poison) = &mut self.poison else { return Ok(()) };
        let (top, Some(before)) = (poison.top, poison.before.take()) else { return Ok(()) };
        let after = self.preempted(before.sp, top);
        if after != before {
            let at = self.image.location(self.cpu.get(Register::PC));
            let (before, after) = (before.registers, after.registers);
            bail!(
                "a control interrupt changed the code it preempted at {at}: {before:x?} became {after:x?}"
            );
        }
        if let Some(poison) = &mut self.poison {
            poison.intact += 1;
            poison.in_floating_point += u64::from(self.cpu.uses_float());
        }
        Ok(())
    }
}
