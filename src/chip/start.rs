//! The start block: the first code after a reset, in the first page of the flash, with nothing set up yet. In assembler, because
//! no Rust may run before statics are initialised, and because nothing outside of the page may be relied on.
//!
//! * A jump of ST's loader begins with a reset: the loader leaves pins and clocks as it has used them.
//! * A reset that [`into_loader`] has requested ends in ST's loader (AN2606: from the state after a reset, with the
//!   system memory at address 0).
//! * Otherwise the CRC unit sums up the image. A wrong sum, or a word that the flash cannot correct, means that an update was cut short:
//!   nothing of the image runs. All pins stay as after a reset but for those of the console, where the answer to each line is that the
//!   image is damaged; `update gates-off` still works.
//! * If the image is whole, the control code is copied from the flash to CCM, where it is fetched without wait states. This is done
//!   first, because the functions that copy and clear memory are part of it.

use core::arch::global_asm;

use crate::board;
use crate::boards::SELECTED;
use crate::boards::identity::Identity;

// SAFETY: in the first page of the flash, between functions; nothing but tools reads it there.
#[used]
#[unsafe(link_section = ".start.board")]
static IDENTITY: Identity = Identity::of(SELECTED);

unsafe extern "C" {
    /// Resets the chip into ST's loader. Only with the outputs off, and the supply of the gate drivers too.
    pub safe fn into_loader() -> !;
    safe static __check: u32;
}

/// The check sum of the image: CRC-32 as of zip, over its pieces (`memory.x`).
pub fn check() -> u32 {
    // SAFETY: a word of the flash, which `cargo firmware` puts in after the compiler.
    unsafe { (&raw const __check).read_volatile() }
}

/// The backup register that outlives a reset (RM0440, TAMP_BKP0R), and the word in it that asks for the loader.
const BACKUP: u32 = 0x4000_2500;
const WORD: u32 = u32::from_le_bytes(*b"load");

global_asm!(
    ".section .start, \"ax\"",
    ".global __pre_init, into_loader, NonMaskableInt",
    ".type __pre_init, %function; .type into_loader, %function; .type NonMaskableInt, %function",
    ".Lblock: .thumb_func",
    "__pre_init: push {{r4, lr}}",
    // If a port already has its clock (AHB2ENR), no reset led here, but the loader's jump.
    "ldr r0, ={rcc}; ldr r1, [r0, #0x4c]; cmp r1, #0; bne .Lreset",
    "ldr r0, ={backup}; ldr r1, [r0]; ldr r2, ={word}; cmp r1, r2; beq .Lenter",
    // Each piece through the CRC unit (AHB1ENR, CRC_CR: bits reversed, from all ones).
    "ldr r0, ={rcc}; ldr r1, [r0, #0x48]; orr r1, #0x1000; str r1, [r0, #0x48]; ldr r1, [r0, #0x48]",
    "ldr r0, ={crc}; movs r1, #0xe1; str r1, [r0, #8]",
    "ldr r2, =__pieces; ldr r12, =__check",
    ".Lpiece: ldm r2!, {{r3, r4}}; b .Lnext", // a piece may be empty
    ".Lsum: ldr r1, [r3], #4; str r1, [r0]",
    ".Lnext: cmp r3, r4; bne .Lsum",
    "cmp r2, r12; bne .Lpiece",
    // An error of the flash raises its interrupt before the next line.
    "dsb; isb",
    "ldr r1, [r2]; ldr r0, [r0]; mvns r0, r0; cmp r0, r1; bne .Ldamaged",
    "ldr r0, =__sccm; ldr r1, =__eccm; ldr r2, =__siccm",
    ".Lcopy: ldm r2!, {{r3}}; stm r0!, {{r3}}; cmp r0, r1; bne .Lcopy",
    // The writes end before the code is fetched.
    "dsb; isb; pop {{r4, pc}}",
    // Clears the request, so that it acts once; then jumps with the system memory at address 0 (SYSCFG_MEMRMP).
    ".Lenter: movs r0, #0; bl .Lkeep",
    "ldr r0, ={rcc}; movs r1, #1; str r1, [r0, #0x60]; ldr r2, [r0, #0x60]",
    "ldr r0, ={syscfg}; str r1, [r0]; dsb",
    "ldr r0, ={system}; ldr r1, [r0]; msr msp, r1; ldr r0, [r0, #4]; bx r0",
    // PA2 and PA3 at LPUART1 (AHB2ENR, APB1ENR2, AFRL, PUPDR, MODER; BRR, CR1), with the clock after a reset.
    ".Ldamaged: ldr r0, ={rcc}; movs r1, #1; str r1, [r0, #0x4c]; str r1, [r0, #0x5c]; ldr r1, [r0, #0x5c]",
    // With the port on already, the flash failed in the text itself, which a loss of power has cut: no text again.
    "ldr r4, ={serial}; ldr r1, [r4]; cmp r1, #0; bne .Lword",
    "ldr r0, ={gpioa}; ldr r1, =0xcc00; str r1, [r0, #0x20]",
    "ldr r1, [r0, #0xc]; orr r1, #0x40; str r1, [r0, #0xc]; ldr r1, [r0]; bic r1, #0x50; str r1, [r0]",
    "ldr r1, ={divider}; str r1, [r4, #0xc]; movs r1, #0xd; str r1, [r4]",
    ".Ltell: ldr r0, =.Lerror; bl .Lsend",
    // r0 points to the next expected character of the phrase, or nowhere. Each word restarts the phrase, because a tag may come before
    // it.
    ".Lword: ldr r0, =.Lphrase",
    ".Lhear: ldr r1, [r4, #0x1c]; lsls r1, #26; bpl .Lhear",
    "movs r1, #8; str r1, [r4, #0x20]; ldr r1, [r4, #0x24]",
    "cmp r1, #13; it ne; cmpne r1, #10; beq .Lline",
    "ldrb r2, [r0]; cmp r1, r2; it eq; addeq r0, #1; beq .Lhear",
    "ldr r0, =.Lnowhere; cmp r1, #32; bne .Lhear; b .Lword",
    ".Lline: ldrb r1, [r0]; cmp r1, #1; bne .Ltell",
    "ldr r0, =.Lok; bl .Lsend",
    ".thumb_func",
    "into_loader: ldr r0, ={word}; bl .Lkeep",
    ".Lreset: ldr r0, ={aircr}; ldr r1, ={reset}; str r1, [r0]; dsb",
    ".Lwait: b .Lwait",
    // Keeps r0 in the backup register (APB1ENR1; PWR_CR1.DBP).
    ".Lkeep: ldr r1, ={rcc}; ldr r2, [r1, #0x58]; orr r2, #0x10000000; str r2, [r1, #0x58]; ldr r2, [r1, #0x58]",
    "ldr r1, ={pwr}; ldr r2, [r1]; orr r2, #0x100; str r2, [r1]",
    "ldr r1, ={backup}; str r0, [r1]; ldr r0, [r1]; dsb; bx lr",
    // Sends the text at r0, up to its last bit; a text that is not written completely ends where the flash is erased.
    ".Lsend: ldrb r1, [r0], #1; subs r2, r1, #1; cmp r2, #0x7f; bhs .Lsent",
    ".Lfull: ldr r2, [r4, #0x1c]; lsls r2, #24; bpl .Lfull; str r1, [r4, #0x28]; b .Lsend",
    ".Lsent: ldr r2, [r4, #0x1c]; lsls r2, #25; bpl .Lsent; bx lr",
    // An error of the flash while the image is summed up is handled as a damaged image; other errors go to the handler.
    ".thumb_func",
    "NonMaskableInt: ldr r0, [sp, #24]; ldr r1, =.Lblock; subs r0, r1; cmp r0, #.Lend - .Lblock; bhs .Lother",
    "ldr r0, ={eccr}; ldr r1, [r0]; str r1, [r0]; ldr r1, =.Ldamaged; str r1, [sp, #24]; bx lr",
    ".Lother: b.w non_maskable",
    ".Lend: .ltorg",
    ".Lnowhere: .byte 0",
    ".Lphrase: .ascii \"update gates-off\"; .byte 1",
    ".Lok: .asciz \"ok: ST's loader is next\\r\\n\"",
    // Last in the block: after a loss of power within this page, what the text asks for can be heard.
    ".Lerror: .asciz \"error: the image is damaged: `update gates-off`, with the supply of the gate drivers off\\r\\n\"",
    ".size __pre_init, into_loader - __pre_init; .size into_loader, NonMaskableInt - into_loader",
    ".size NonMaskableInt, .Lend - NonMaskableInt",
    backup = const BACKUP,
    word = const WORD,
    rcc = const 0x4002_1000_u32,
    crc = const 0x4002_3000_u32,
    pwr = const 0x4000_7000_u32,
    syscfg = const 0x4001_0000_u32,
    gpioa = const 0x4800_0000_u32,
    serial = const 0x4000_8000_u32,
    eccr = const 0x4002_2018_u32,
    aircr = const 0xe000_ed0c_u32,
    reset = const 0x05fa_0004_u32,
    system = const 0x1fff_0000_u32,
    divider = const board::serial_divider(board::HSI_HZ, board::SERIAL_BAUD),
);
