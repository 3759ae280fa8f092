//! The two interfaces of the console: to the rest of the firmware beside the command arbiter's drive, and to the serial port.

use core::fmt::{self, Write};

use crate::desk::handle::DriveHandle;
use crate::history::History;
use crate::log::Level;
use crate::recording::ring::Record;
use crate::recording::trace::{self, Plan};
use crate::rotor_tracking::Report;

/// Access of the console to the rest of the firmware.
pub trait Firmware: DriveHandle {
    /// State of the tracking of the rotor time constant, if it is enabled.
    fn tracking(&self) -> Option<Report>;
    /// Operating hours, starts and faults since the beginning.
    fn history(&self) -> &History;
    /// Starts a trace; `false`, and nothing changed, while one is being recorded.
    fn begin_trace(&mut self, plan: &Plan) -> bool;
    /// Ends a recording without a result.
    fn cancel_trace(&mut self);
    /// Whether a trace is being recorded.
    fn tracing(&self) -> bool;
    /// Record number `i` of the last trace, and its position relative to the trigger's record.
    fn traced(&self, i: u16) -> Option<(i16, trace::Record)>;
    /// Requests a record of each control period whose number is a multiple of `divider`, or of one of the next two; 0 ends it.
    fn stream(&mut self, divider: u16);
    /// The next record for the stream.
    fn sampled(&mut self) -> Option<Record>;
    /// Sets how much is logged.
    fn set_log_level(&mut self, _: Level) {}
    /// Most bytes of the stack used so far, and its size.
    fn stack(&self) -> (usize, usize);
    /// Writes the version of the firmware.
    ///
    /// # Errors
    /// Those of `to`.
    fn version(&self, to: &mut dyn Write) -> fmt::Result;
    /// Writes the cause of the last reset and the end of the last run.
    ///
    /// # Errors
    /// Those of `to`.
    fn last_run(&self, to: &mut dyn Write) -> fmt::Result;
}

/// The console's end of the serial port.
pub trait Port {
    /// The next received byte.
    fn read(&mut self) -> Option<u8>;
    /// Whether bytes were lost or damaged since the last call.
    fn take_damage(&mut self) -> bool;
    /// Sends all bytes; `false`, and nothing sent, if they do not fit now.
    fn write(&mut self, bytes: &[u8]) -> bool;
    /// Changes the bits per second as soon as all bytes are sent; `false` if the change is still to come: call it again.
    fn change_rate(&mut self, baud: u32) -> bool;
}
