//! Addresses of the control interrupt's data, published for tools that read the memory of a running drive: the
//! virtual board, a debugger.
//!
//! The table is the symbol `INDUCTION_DRIVE_ADDRESSES`: 32-bit words, little-endian, in the order of [`Table`].
//! [`VERSION`] counts changes of that order.

use core::mem::{offset_of, size_of};

use drive_core::{Command, Drive};
use induction_drive::link::mailbox::Mailbox;

use super::{Control, RUNNING, Running};

/// Version of the layout of [`Table`].
const VERSION: usize = 2;

/// The layout of the table. Sizes and offsets are in bytes.
#[repr(C)]
struct Table {
    version: usize,
    /// The interrupt's own data, and their size. Written before the interrupt is unmasked.
    control: (*const u8, usize),
    /// The coefficients of the drive, and their size. They change only with a command.
    coefficients: (*const u8, usize),
    /// The state of the drive that changes while it regulates, and its size.
    state: (*const u8, usize),
    /// A pointer to the mailbox of commands.
    commands: *const u8,
    /// Offset in that mailbox of a byte that is 1 while a command waits for the interrupt.
    command_waits: usize,
    /// Estimated rotor-flux angle at the last sample, a `u32` fraction of an electrical turn.
    phi: *const u8,
    /// Electrical speed of the rotor, turns per period, `f32`.
    rotor_freq: *const u8,
    /// Filtered reference of the quadrature current, A, `f32`.
    reference_q: *const u8,
    /// Filtered quadrature current, A, `f32`.
    current_q: *const u8,
    /// Dc-link voltage, V, `f32`.
    dc_link: *const u8,
}

// SAFETY: only addresses, which the firmware itself never follows.
unsafe impl Sync for Table {}

/// The address at this offset in the drive.
const fn in_drive(offset: usize) -> *const u8 {
    in_control(offset_of!(Control, drive) + offset)
}

/// The address at this offset in [`Control`].
const fn in_control(offset: usize) -> *const u8 {
    RUNNING.0.get().cast::<u8>().cast_const().wrapping_add(offset_of!(Running, control) + offset)
}

// SAFETY: the only symbol of this name in the image.
#[used]
#[unsafe(no_mangle)]
static INDUCTION_DRIVE_ADDRESSES: Table = Table {
    version: VERSION,
    control: (RUNNING.0.get().cast::<u8>().cast_const(), size_of::<Running>()),
    coefficients: (
        in_drive(Drive::COEFFICIENTS.start),
        Drive::COEFFICIENTS.end - Drive::COEFFICIENTS.start,
    ),
    state: (
        in_drive(Drive::LAYOUT.state.start),
        Drive::LAYOUT.state.end - Drive::LAYOUT.state.start,
    ),
    commands: in_control(offset_of!(Control, commands)),
    command_waits: Mailbox::<Command>::FULL,
    phi: in_drive(Drive::LAYOUT.phi),
    rotor_freq: in_drive(Drive::LAYOUT.rotor_freq),
    reference_q: in_drive(Drive::LAYOUT.reference_q),
    current_q: in_drive(Drive::LAYOUT.current_q),
    dc_link: in_drive(Drive::LAYOUT.dc_link),
};
