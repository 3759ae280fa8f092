//! The end of a run when the firmware cannot go on: outputs off first, then the reason into RAM that
//! start-up does not clear, then a reset. The next boot reports the reason.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use defmt::Display2Format;
use stm32g4xx_hal::pac;

use crate::board;
use crate::chip::{flash, pwm};
use crate::monitor::record::{Reason, Record, WORDS};

/// Words of RAM that keep their contents over a reset.
struct Kept<const N: usize>(UnsafeCell<MaybeUninit<[u32; N]>>);

// SAFETY: plain words, only read and written volatile, by start-up code and by handlers that do not
// return. A handler may interrupt a write of the main loop; the hash of the record detects that.
unsafe impl<const N: usize> Sync for Kept<N> {}

// SAFETY: the section that cortex-m-rt leaves as it is, which `MaybeUninit` allows for.
#[unsafe(link_section = ".uninit.record")]
static RECORD: Kept<WORDS> = Kept(UnsafeCell::new(MaybeUninit::uninit()));
/// Number of consecutive unintended resets, and its complement.
// SAFETY: as above.
#[unsafe(link_section = ".uninit.resets")]
static RESETS: Kept<2> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

impl<const N: usize> Kept<N> {
    fn write(&self, words: [u32; N]) {
        // SAFETY: see `Kept`.
        unsafe { ptr::write_volatile(self.0.get().cast(), words) };
    }

    fn read(&self) -> [u32; N] {
        // SAFETY: see `Kept`; any contents of the RAM are valid words.
        unsafe { ptr::read_volatile(self.0.get().cast()) }
    }
}

/// Keeps a record for the next boot.
pub fn keep(reason: Reason, details: [u32; 4]) {
    RECORD.write(Record { reason, details }.to_words());
}

/// The record of the last run, once.
pub fn take_record() -> Option<Record> {
    let record = Record::from_words(&RECORD.read());
    RECORD.write([0; WORDS]);
    record
}

/// Counts consecutive unintended resets, without [`forget_resets`] between them.
pub fn count_reset(unintended: bool) -> u32 {
    let [count, complement] = RESETS.read();
    let before = if unintended && count == !complement { count } else { 0 };
    let count = before.saturating_add(u32::from(unintended));
    RESETS.write([count, !count]);
    count
}

/// Sets the count of unintended resets to zero, after a while without any.
pub fn forget_resets() {
    RESETS.write([0, !0]);
}

/// Switches the outputs off, keeps the reason, and resets the chip.
pub fn end(reason: Reason, details: [u32; 4]) -> ! {
    pwm::outputs_off();
    keep(reason, details);
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    pwm::outputs_off();
    cortex_m::interrupt::disable();
    let line = info.location().map_or(0, |place| place.line());
    // Before the log, which the window watchdog may cut short.
    keep(Reason::Panic, [line, 0, 0, 0]);
    // Once: a panic while logging would come back here for ever.
    static PANICKED: AtomicBool = AtomicBool::new(false);
    if !PANICKED.swap(true, Ordering::Relaxed) {
        defmt::error!("{}", Display2Format(info));
    }
    SCB::sys_reset()
}

/// Handler of processor faults. The cause may be a stack overflow, so it clears MOE before anything else and begins a fresh stack, both
/// without an access to the old stack.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")] // SAFETY: the name in the vector table of cortex-m-rt.
#[unsafe(link_section = ".HardFault.user")] // SAFETY: the section of cortex-m-rt for it.
unsafe extern "C" fn hard_fault() -> ! {
    core::arch::naked_asm!(
        "ldr r0, ={bdtr}",
        "ldr r1, [r0]",
        "bic r1, r1, #{moe}",
        "str r1, [r0]",
        // The frame of the fault, if there is one: program counter and link register.
        "mrs r3, msp",
        "movs r0, #0",
        "movs r1, #0",
        "ldr r2, =_stack_end",
        "cmp r3, r2",
        "blo 2f",
        "ldr r2, =_stack_start",
        "subs r2, #32",
        "cmp r3, r2",
        "bhi 2f",
        "ldr r0, [r3, #24]",
        "ldr r1, [r3, #20]",
        "2:",
        "ldr r2, =_stack_start",
        "msr msp, r2",
        "b {after}",
        bdtr = const board::TIM1_BDTR,
        moe = const board::TIM1_BDTR_MOE,
        after = sym after_hard_fault,
    )
}

extern "C" fn after_hard_fault(program_counter: u32, link: u32) -> ! {
    // SAFETY: reads two registers; nothing else runs any more.
    let scb = unsafe { &*SCB::PTR };
    end(Reason::HardFault, [program_counter, link, scb.cfsr.read(), scb.bfar.read()])
}

/// Handler of a stopped crystal, and of an error in the flash that cannot be corrected. If the crystal does not start again after the
/// reset, the firmware runs from the internal oscillator.
///
/// A double word of the settings that a power failure has torn does not stop the firmware. The vector leads to the start block, which
/// calls this handler once it has gone on to `main`.
#[unsafe(no_mangle)] // SAFETY: the name that `start.rs` calls, defined nowhere else.
extern "C" fn non_maskable() {
    if flash::forgive_torn() {
        return;
    }
    pwm::outputs_off();
    // SAFETY: reads two registers; nothing else runs any more.
    let (rcc, flash) = unsafe { (&*pac::RCC::ptr(), &*pac::FLASH::ptr()) };
    end(Reason::NonMaskable, [rcc.cifr().read().bits(), flash.eccr().read().bits(), 0, 0])
}

/// Handler of interrupts without one of their own.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end(Reason::Unexpected, [number as u32, 0, 0, 0])
}
