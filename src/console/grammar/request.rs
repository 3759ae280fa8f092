//! The request of a valid line.

use drive_core::Fault;
use heapless::Vec;

use super::recording::Stream;
use crate::desk::order::Order;
use crate::link::trace::Plan;
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
    /// List all commands.
    Help,
    /// Show the state of the drive.
    Status,
    /// Show one setting.
    Get(Key),
    /// List the settings whose names begin so.
    List(&'static str),
    /// List them as JSON.
    Describe(&'static str),
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
    /// Show operating hours, starts and the last faults.
    History,
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
    /// List the signals and the layout of a frame as JSON.
    Signals,
    /// Set the bits per second of the port.
    Baud(u32),
    /// Set how much is logged.
    Log(Level),
    /// Show the board with its assumptions.
    Board,
    /// Show the version of the firmware.
    Version,
}

impl From<Order> for Request {
    fn from(order: Order) -> Self {
        Self::Order(order)
    }
}

/// Level of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Nothing.
    Off,
    /// Faults.
    Error,
    /// Events that need attention as well.
    Warn,
    /// Changes of state as well.
    Info,
    /// The drive's operating point, once a second, as well.
    Debug,
}

/// Names of the levels, in order.
pub const LEVELS: [(&str, Level); 5] = [
    ("off", Level::Off),
    ("error", Level::Error),
    ("warn", Level::Warn),
    ("info", Level::Info),
    ("debug", Level::Debug),
];
