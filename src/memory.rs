//! What the linker script lays out: the control code in CCM, and the stack, with nothing below it.
#![cfg(target_os = "none")]

use core::ptr;

use cortex_m::register::msp;

unsafe extern "C" {
    static mut _stack_start: u32;
    static mut _stack_end: u32;
}

/// Copies the control code from the flash to CCM, where it is fetched without wait states.
///
/// Called by the start-up code before anything else, because the functions that copy and clear memory
/// are among what is copied; in assembler, because no Rust may run before statics are initialised.
#[unsafe(naked)]
#[unsafe(export_name = "__pre_init")] // SAFETY: the name cortex-m-rt calls, defined nowhere else.
unsafe extern "C" fn copy_control_code() {
    core::arch::naked_asm!(
        "ldr r0, =__sccm",
        "ldr r1, =__eccm",
        "ldr r2, =__siccm",
        "2:",
        "cmp r0, r1",
        "beq 3f",
        "ldm r2!, {{r3}}",
        "stm r0!, {{r3}}",
        "b 2b",
        "3:",
        // What was written must be what is fetched.
        "dsb",
        "isb",
        "bx lr",
    )
}

/// The build id: a hash that the linker makes of the image, so that what runs can be told from what was
/// built. Behind the note's header (12 bytes) and its name, `GNU`.
pub fn build_id() -> [u8; 8] {
    const BEHIND: usize = 16;
    unsafe extern "C" {
        static _build_id: u8;
    }
    // SAFETY: memory.x puts the note there; it holds a hash of 8 bytes at least, and never changes.
    unsafe { (&raw const _build_id).add(BEHIND).cast::<[u8; 8]>().read() }
}

/// What unused stack holds.
const PAINT: u32 = 0xc5c5_c5c5;
/// Words above the stack pointer's next use that are left alone, for what calls `paint_stack`.
const MARGIN_WORDS: usize = 16;

/// Paints the unused stack. Once, first thing in `main`.
pub fn paint_stack() {
    let end = &raw mut _stack_end;
    let used_from = msp::read() as usize;
    let words = used_from.saturating_sub(end as usize) / size_of::<u32>();
    for i in 0..words.saturating_sub(MARGIN_WORDS) {
        // SAFETY: between the end of the stack and the stack pointer lies nothing that is in use.
        unsafe { ptr::write_volatile(end.add(i), PAINT) };
    }
}

/// Most bytes of the stack that were ever used.
pub fn stack_used() -> usize {
    let end = &raw const _stack_end;
    let words = stack_size() / size_of::<u32>();
    // SAFETY: all of it is stack; volatile, because interrupts write there.
    let unused = (0..words).take_while(|i| unsafe { ptr::read_volatile(end.add(*i)) } == PAINT);
    stack_size() - unused.count() * size_of::<u32>()
}

/// Size of the stack, bytes.
pub fn stack_size() -> usize {
    (&raw const _stack_start as usize) - (&raw const _stack_end as usize)
}
