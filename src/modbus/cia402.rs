//! Control word and status word of CiA 402 (IEC 61800-7-201).

use drive_core::Stop;

/// Command bits of the control word.
const SWITCH_ON: u16 = 1 << 0;
const ENABLE_VOLTAGE: u16 = 1 << 1;
/// A quick stop if the bit is 0.
const QUICK_STOP: u16 = 1 << 2;
const ENABLE_OPERATION: u16 = 1 << 3;
/// Bit of the control word: clear the latched fault.
pub const FAULT_RESET: u16 = 1 << 7;

/// The control word that commands a run.
pub const RUN: u16 = SWITCH_ON | ENABLE_VOLTAGE | QUICK_STOP | ENABLE_OPERATION;
/// The control word of a drive that is stopped: shutdown.
pub const SHUTDOWN: u16 = ENABLE_VOLTAGE | QUICK_STOP;

/// The stop that a control word commands; `None` for a run. Disable voltage switches off at once, a quick stop brakes by its own ramp,
/// and shutdown, switch on and disable operation brake by the ramp of the speed.
pub const fn stop(control_word: u16) -> Option<Stop> {
    if control_word & ENABLE_VOLTAGE == 0 {
        Some(Stop::Now)
    } else if control_word & QUICK_STOP == 0 {
        Some(Stop::Quick)
    } else if control_word & RUN == RUN {
        None
    } else {
        Some(Stop::Ramp)
    }
}

/// Bit of the status word: the dc link is above its lower limit.
pub const VOLTAGE_ENABLED: u16 = 1 << 4;
/// Bit of the status word, manufacturer-specific: the drive is off, and the speed is the last measured one.
pub const SPEED_ASSUMED: u16 = 1 << 14;
/// Bit of the status word: the bus commands.
pub const REMOTE: u16 = 1 << 9;
/// Bit of the status word: the speed is within 1 % of `speed.limit_rpm` of its reference.
pub const TARGET_REACHED: u16 = 1 << 10;
