//! Memory laid out by the linker script: the control code in CCM, and the stack, with a guard at its end.

use core::ptr;

use cortex_m::peripheral::MPU;
use cortex_m::register::msp;

use crate::monitor::memory_check::MemoryRange;

unsafe extern "C" {
    static mut _stack_start: u32;
    static mut _stack_end: u32;
}

/// The code in CCM, and the address it was copied from.
pub fn control_code() -> (MemoryRange, u32) {
    unsafe extern "C" {
        static __sccm: u32;
        static __eccm: u32;
        static __siccm: u32;
    }
    let [begin, end, source] =
        [&raw const __sccm, &raw const __eccm, &raw const __siccm].map(|at| at as u32);
    (MemoryRange { address: begin, words: (end - begin) / size_of::<u32>() as u32 }, source)
}

/// The word at an address that is a multiple of 4, in the flash, in RAM, or of a register whose read has no effect.
pub fn word(address: u32) -> u32 {
    let word;
    // SAFETY: all callers pass addresses of statics or of configuration registers, and reading these changes nothing. The read is in
    // assembler because the word may be padding or belong to the interrupt, and a read in Rust may touch neither. A word is read whole,
    // before or after a write of the interrupt.
    unsafe {
        core::arch::asm!(
            "ldr {word}, [{address}]",
            address = in(reg) address,
            word = lateout(reg) word,
            options(readonly, nostack, preserves_flags),
        );
    }
    word
}

/// The build id: the linker's hash of the image, which identifies the running build. It follows the note's header
/// (12 bytes) and its name, `GNU`.
pub fn build_id() -> [u8; 8] {
    const BEHIND: usize = 16;
    unsafe extern "C" {
        static _build_id: u8;
    }
    // SAFETY: memory.x puts the note there; it holds a hash of 8 bytes at least, and never changes.
    unsafe { (&raw const _build_id).add(BEHIND).cast::<[u8; 8]>().read() }
}

/// Bytes at the end of the stack that no access reaches: the smallest region of the memory protection unit.
const GUARD_BYTES: usize = 32;

/// Makes the last bytes of the stack inaccessible: an overflow ends in the fault handler, which begins a fresh stack.
pub fn guard_stack(mpu: &mut MPU) {
    let end = &raw const _stack_end as u32;
    // Region 0: 2^(SIZE + 1) bytes, no access, no execution. Elsewhere the default memory map applies, and in the fault handlers no
    // region does.
    const SIZE: u32 = GUARD_BYTES.trailing_zeros() - 1;
    // SAFETY: the region lies below the used part of the stack, and is no other memory.
    unsafe {
        mpu.rbar.write(end | 1 << 4);
        mpu.rasr.write(1 << 28 | SIZE << 1 | 1);
        mpu.ctrl.write(1 << 2 | 1);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Contents of unused stack.
const PAINT: u32 = 0xc5c5_c5c5;
/// Words below the stack pointer that are not painted: room for `paint_stack` itself.
const MARGIN_WORDS: usize = 16;

/// Paints the unused stack; called once, first in `main`.
pub fn paint_stack() {
    let end = &raw mut _stack_end;
    let used_from = msp::read() as usize;
    let words = used_from.saturating_sub(end as usize) / size_of::<u32>();
    for i in GUARD_BYTES / size_of::<u32>()..words.saturating_sub(MARGIN_WORDS) {
        // SAFETY: between the end of the stack and the stack pointer lies nothing that is in use.
        unsafe { ptr::write_volatile(end.add(i), PAINT) };
    }
}

/// Most bytes of the stack used so far.
pub fn stack_used() -> usize {
    // SAFETY: within the stack.
    let end = unsafe { (&raw const _stack_end).add(GUARD_BYTES / size_of::<u32>()) };
    let words = stack_size() / size_of::<u32>();
    // SAFETY: all of it is stack; volatile, because interrupts write there.
    let unused = (0..words).take_while(|i| unsafe { ptr::read_volatile(end.add(*i)) } == PAINT);
    stack_size() - unused.count() * size_of::<u32>()
}

/// Size of the stack, bytes.
pub fn stack_size() -> usize {
    (&raw const _stack_start as usize) - (&raw const _stack_end as usize) - GUARD_BYTES
}
