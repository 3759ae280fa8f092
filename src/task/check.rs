//! The check of the control's memory and registers, by the main loop.

use cortex_m::singleton;

use crate::chip::{memory, stop};
use crate::task::control;
use induction_drive::monitor::memory_check::{BitFlip, CheckedMemory, MemoryCheck};
use induction_drive::monitor::record::Reason;
use induction_drive::monitor::register_check::{COUNT, Changed, RegisterCheck};

/// The check and its progress.
pub struct Check {
    memory: MemoryCheck<2>,
    registers: RegisterCheck,
}

impl Check {
    /// The check of a control that runs; on the first call only.
    pub fn new() -> Option<Self> {
        let expected = singleton!(: [u32; COUNT] = [0; COUNT])?;
        let (code, source) = memory::control_code();
        let (constants, changes) = control::constants();
        let checked = CheckedMemory { code, source, constants, changes };
        Some(Self {
            memory: MemoryCheck::new(checked, memory::word),
            registers: RegisterCheck::new(expected, memory::word),
        })
    }

    /// Checks a slice. A flipped bit ends the run: start-up copies the code, computes the coefficients and sets the
    /// registers up afresh.
    pub fn slice(&mut self) {
        if let Err(Changed { address, found, expected }) = self.registers.slice(memory::word) {
            stop::end(Reason::Register, [address, found, expected, 0]);
        }
        match self.memory.slice(memory::word) {
            Err(BitFlip::Code { address, found, copied }) => {
                stop::end(Reason::Code, [address, found, copied, 0]);
            }
            Err(BitFlip::Constants { found, before }) => {
                stop::end(Reason::Coefficients, [found, before, 0, 0]);
            }
            Ok(()) => {}
        }
    }
}
