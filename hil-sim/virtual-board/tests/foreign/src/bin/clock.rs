//! The clock, and a pin that toggles.
#![no_std]
#![no_main]

use embassy_stm32::gpio::{Level, Output, Speed};

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_stm32::init(foreign::clocks());
    let mut led = Output::new(p.PA5, Level::Low, Speed::Low);
    loop {
        led.toggle();
        cortex_m::asm::delay(17_000);
    }
}
