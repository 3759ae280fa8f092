//! A line from LPUART1.
#![no_std]
#![no_main]

use embassy_stm32::usart::{Config, UartTx};

#[cortex_m_rt::entry]
fn main() -> ! {
    let p = embassy_stm32::init(foreign::clocks());
    let port = UartTx::new_blocking(p.LPUART1, p.PA2, Config::default());
    let Ok(mut port) = port else { panic!() };
    port.blocking_write(b"hello from embassy\n").ok();
    loop {
        cortex_m::asm::nop();
    }
}
