//! The speed of the console's serial port.

use crate::board::{CLOCK_HZ, HSI_HZ};
pub use crate::board::{SERIAL_BAUD as USUAL, serial_divider as divider};

/// Highest rate that `baud` takes, bits per second: a byte is 850 core cycles, so that the FIFO of eight bytes outlasts the
/// longest control interrupt.
pub const HIGHEST: u32 = 2_000_000;
/// Time without a valid line after which the port goes back to [`USUAL`], ms.
pub const FALL_BACK_MS: u32 = 1000;

// Range of the register.
const _: () = {
    assert!(divider(CLOCK_HZ, USUAL) <= 0xf_ffff);
    assert!(divider(HSI_HZ, HIGHEST) >= 0x300);
};
