//! The check of the control's memory and registers, by the main loop.

use core::mem::MaybeUninit;
use core::sync::atomic::Ordering;

use cortex_m::singleton;

use crate::task::control;
use induction_drive::chip::{memory, stop};
use induction_drive::monitor::memory_check::{CheckedMemory, MemoryCheck};
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::monitor::register_check::{COUNT, RegisterCheck};

/// The check and its progress.
pub struct Check {
    memory: MemoryCheck<2>,
    registers: RegisterCheck,
}

impl Check {
    /// The check of a running control; only the first call returns it.
    pub fn new() -> Option<Self> {
        // Filled outside the macro, which masks the interrupts, because the control runs already.
        let expected = singleton!(: MaybeUninit<[u16; COUNT]> = MaybeUninit::uninit())?;
        let expected = expected.write([0; COUNT]);
        let (code, source) = memory::control_code();
        let (constants, changes) = control::constants();
        let checked = CheckedMemory { code, source, constants, changes };
        Some(Self {
            memory: MemoryCheck::new(checked, memory::word),
            registers: RegisterCheck::new(expected, memory::word),
        })
    }

    /// Takes the present registers as the reference, after pins have been connected.
    pub fn renew(&mut self) {
        self.registers.renew(memory::word);
    }

    /// Checks a slice. A flipped bit ends the run: the next start copies the code, computes the coefficients and sets the registers up
    /// again.
    pub fn slice(&mut self) {
        let broken = control::BROKEN.load(Ordering::Relaxed);
        if broken != 0 {
            stop::end(Reason::State, [broken, 0, 0, 0]);
        }
        let registers = self.registers.slice(memory::word);
        let checked = registers.and_then(|()| self.memory.slice(memory::word));
        if let Err(Record { reason, details }) = checked {
            stop::end(reason, details);
        }
    }
}
