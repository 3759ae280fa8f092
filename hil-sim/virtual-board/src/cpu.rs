//! What the board needs of an emulated core, so that the emulator can be replaced.

use crate::chip::Chip;

/// Registers that exception entry and return, and tests, handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Register {
    /// R0 to R12.
    R(u8),
    /// Stack pointer in use: the main one, the firmware has no other.
    Sp,
    /// Link register.
    Lr,
    /// Program counter.
    Pc,
    /// Program status, all parts.
    Xpsr,
    /// Exception mask.
    Primask,
    /// Priority mask.
    Basepri,
}

/// Why the core stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// It waits for an interrupt.
    Wait,
    /// The chip wants to be looked at: time of an event, a pended exception, a failure.
    Asked,
    /// It branched to this EXC_RETURN.
    Return(u32),
    /// An access to where nothing is, a fetch from there, or no instruction.
    Fault(Fault),
}

/// What the bus or the decoder refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Access to this address.
    Access(u32),
    /// No such instruction, or a fetch from where none is.
    Instruction,
}

/// An Arm Cortex-M4F with the chip around it.
pub trait Cpu {
    /// The chip.
    fn chip(&self) -> &Chip;
    /// The chip, to change it.
    fn chip_mut(&mut self) -> &mut Chip;
    /// Runs from `Pc` until something stops it.
    fn run(&mut self) -> Stop;
    /// A register.
    fn get(&self, register: Register) -> u32;
    /// Sets a register.
    fn set(&mut self, register: Register, value: u32);
    /// Pushes the frame of an exception and goes to its `handler`; `false` if the stack is not there.
    fn enter(&mut self, exception: u16, handler: u32) -> bool;
    /// Pops the frame of an exception; `false` if the stack is not there.
    fn leave(&mut self, exc_return: u32) -> bool;
    /// Reads memory, not registers; `false` where there is none.
    fn read(&self, address: u32, bytes: &mut [u8]) -> bool;
    /// Writes memory, flash included.
    fn write(&mut self, address: u32, bytes: &[u8]) -> bool;
    /// Registers as after a reset, stack pointer and program counter from the vector table.
    fn reset(&mut self, vectors: u32);

    /// A word of memory.
    fn word(&self, address: u32) -> Option<u32> {
        let mut bytes = [0; 4];
        self.read(address, &mut bytes).then(|| u32::from_le_bytes(bytes))
    }
}
