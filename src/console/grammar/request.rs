//! The request of a valid line.

use drive_core::Fault;
use heapless::Vec;

use crate::desk::order::Order;
use crate::log::Level;
use crate::recording::stream::Stream;
use crate::recording::trace::Plan;
use crate::settings::keys::Key;
use crate::settings::staging::Assignments;

/// Words of a learned result in a line of `backup`.
pub const WORDS_IN_LINE: usize = 8;

/// A valid line.
// Exists once at a time.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// A request to the command arbiter.
    Order(Order),
    /// Stage settings.
    Set(Assignments),
    /// A reply of many lines.
    List(ListKind),
    /// Show the state of the drive.
    Status,
    /// Show one setting.
    Get(Key),
    /// List the lines that restore settings and learned values.
    Backup,
    /// List the result of the last self-commissioning.
    Learned,
    /// Words of a learned result, from this index on.
    Restore(usize, Vec<u32, WORDS_IN_LINE>),
    /// The checksum over all words of a learned result, which completes it.
    Restored(u32),
    /// Show the latched fault and the last reset, or the text of a fault.
    Faults(Option<Fault>),
    /// Record a trace.
    Trace(Plan),
    /// Print the last trace.
    ShowTrace,
    /// End the recording of a trace.
    EndTrace,
    /// Stream signals.
    Stream(Stream),
    /// Show the stream.
    StreamState,
    /// End the stream.
    EndStream,
    /// Set the bits per second of the port.
    Baud(u32),
    /// Set how much is logged.
    Log(Level),
    /// Show the version of the firmware.
    Version,
}

impl From<Order> for Request {
    fn from(order: Order) -> Self {
        Self::Order(order)
    }
}

/// Kind of a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ListKind {
    /// All commands.
    Help,
    /// The settings whose names begin with this text.
    Settings(&'static str),
    /// The same settings as JSON.
    Describe(&'static str),
    /// The lines that restore settings and learned values.
    Backup,
    /// The board with its assumptions.
    Board,
    /// The result of the last self-commissioning.
    Learned,
    /// Causes and cure of a fault.
    Fault(Fault),
    /// Operating hours, starts and the last faults.
    History,
    /// The last trace.
    Trace,
    /// The signals and the layout of a frame.
    Signals,
}
