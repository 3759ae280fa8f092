//! A check that control interrupts leave the preempted code intact: registers, stack, and the floating-point registers.
//! The latter are poisoned as the interrupt begins, so that a register that is not restored becomes visible.

use anyhow::{Result, bail};

use super::{Board, Cpu};
use stm32g4_unicorn::cpu::Register;
use stm32g4_unicorn::memory;

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

impl Preempted {
    /// Returns the state of the core, with the stack between two addresses.
    fn new(cpu: &Cpu, sp: u32, top: u32) -> Self {
        let mut stack = vec![0; top.saturating_sub(sp.max(memory::RAM)) as usize];
        cpu.read(sp, &mut stack);
        Self { registers: cpu.registers(), sp, stack }
    }
}

impl Board {
    /// Stores the state before a control interrupt.
    pub(super) fn remember(&mut self) {
        let Some(poison) = &mut self.poison else { return };
        let sp = self.cpu.get(Register::SP);
        poison.before = Some(Preempted::new(&self.cpu, sp, poison.top));
    }

    /// Compares the state after a control interrupt with the state before it.
    ///
    /// # Errors
    /// The states differ.
    pub(super) fn compare_with_before(&mut self) -> Result<()> {
        let Some(poison) = &mut self.poison else { return Ok(()) };
        let Some(before) = poison.before.take() else { return Ok(()) };
        let after = Preempted::new(&self.cpu, before.sp, poison.top);
        if after != before {
            let at = self.image.location(self.cpu.get(Register::PC));
            let (before, after) = (before.registers, after.registers);
            bail!(
                "a control interrupt changed the code it preempted at {at}: {before:x?} became {after:x?}"
            );
        }
        poison.intact += 1;
        poison.in_floating_point += u64::from(self.cpu.uses_float());
        Ok(())
    }
}
