//! Addresses of the control interrupt's data, published for tools that read the memory of a running drive: the
//! virtual board, a debugger.
//!
//! The table is the symbol `INDUCTION_DRIVE_ADDRESSES`: 32-bit words, little-endian, in the order of [`Table`].
//! [`VERSION`] counts changes of that order.

use core::mem::{offset_of, size_of};

use drive_core::{Coefficients, Command, Drive, Telemetry};
use induction_drive::link::mailbox::Mailbox;

use super::{Control, RUNNING, Running};

/// Version of the layout of [`Table`].
const VERSION: usize = 4;

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
    /// The [`Telemetry`](drive_core::Telemetry) of the last step with the outputs on.
    telemetry: *const u8,
    /// The word of the drive's phase: one of [`Drive::PHASES`].
    phase: *const u8,
}

// SAFETY: only addresses, which the firmware itself never follows.
unsafe impl Sync for Table {}

/// Offset in the drive of its state, which follows the count of changes.
const STATE: usize = <Drive>::CHANGES + size_of::<u32>();

/// The address at this offset in the drive.
const fn in_drive(offset: usize) -> *const u8 {
    in_control(offset_of!(Control, drive) + offset)
}

/// The address at this offset in [`Control`].
const fn in_control(offset: usize) -> *const u8 {
    RUNNING.0.get().cast::<u8>().cast_const().wrapping_add(offset_of!(Running, control) + offset)
}

/// The voltage of the dc link at the last step with the outputs on, V, a floating-point number.
pub const DC_LINK: *const u8 = in_drive(<Drive>::TELEMETRY + offset_of!(Telemetry, dc_link));

// SAFETY: the only symbol of this name in the image.
#[used]
#[unsafe(no_mangle)]
static INDUCTION_DRIVE_ADDRESSES: Table = Table {
    version: VERSION,
    control: (RUNNING.0.get().cast::<u8>().cast_const(), size_of::<Running>()),
    coefficients: (in_drive(<Drive>::COEFFICIENTS.start), size_of::<Coefficients>()),
    state: (in_drive(STATE), size_of::<Drive>() - STATE),
    commands: in_control(offset_of!(Control, commands)),
    command_waits: Mailbox::<Command>::FULL,
    telemetry: in_drive(<Drive>::TELEMETRY),
    phase: in_drive(<Drive>::PHASE),
};
