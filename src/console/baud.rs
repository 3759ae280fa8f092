//! The speed of the console's serial port: 8 data bits, no parity, 1 stop bit.

use crate::board::{CLOCK_HZ, HSI_HZ};

/// Bits per second after a reset.
pub const USUAL: u32 = 115_200;
/// Highest rate that `baud` takes, bits per second: a byte is 850 core cycles, so that the FIFO of eight bytes outlasts the
/// longest control interrupt.
pub const HIGHEST: u32 = 2_000_000;
/// Time without a valid line after which the port goes back to [`USUAL`], ms.
pub const FALL_BACK_MS: u32 = 1000;

/// Ticks of LPUART1's clock, Hz, per bit, in 1/256 (RM0440, LPUART_BRR), rounded.
pub const fn divider(clock_hz: u32, baud: u32) -> u32 {
    ((256 * clock_hz as u64 + baud as u64 / 2) / baud as u64) as u32
}
// Range of the register.
const _: () = {
    assert!(divider(CLOCK_HZ, USUAL) <= 0xf_ffff);
    assert!(divider(HSI_HZ, HIGHEST) >= 0x300);
};
