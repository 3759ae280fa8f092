//! What happens when the firmware cannot go on: outputs off first, then a word to the log.
#![cfg(target_os = "none")]

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;
use defmt::Display2Format;

use crate::pwm;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    pwm::outputs_off();
    cortex_m::interrupt::disable();
    // Once: a panic while logging would come back here for ever.
    static PANICKED: AtomicBool = AtomicBool::new(false);
    if !PANICKED.swap(true, Ordering::Relaxed) {
        defmt::error!("{}", Display2Format(info));
    }
    // A debugger that is attached stops at the fault and shows how we came here.
    cortex_m::asm::udf()
}

/// A fault of the processor.
#[exception(trampoline = false)]
unsafe fn HardFault() -> ! {
    halt()
}

/// The crystal has stopped, or the flash has an error that cannot be corrected.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    halt()
}

/// Everything nobody expects.
#[exception]
unsafe fn DefaultHandler(_number: i16) -> ! {
    halt()
}

fn halt() -> ! {
    pwm::outputs_off();
    loop {
        cortex_m::asm::nop();
    }
}
