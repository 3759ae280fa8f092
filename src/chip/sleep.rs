//! Sleep until an interrupt.

/// Sleeps until the next interrupt.
///
/// The function is in the CCM with the control code, and has a barrier after the sleep: on relatives of this chip the first fetch from
/// the flash after a sleep may fail while a debug probe keeps the clock on. It is in assembler, so that it stays in one piece.
#[unsafe(naked)]
// SAFETY: memory.x puts the section into the CCM.
#[unsafe(link_section = ".text.until_interrupt")]
pub extern "C" fn until_interrupt() {
    core::arch::naked_asm!("wfi", "isb", "bx lr")
}
