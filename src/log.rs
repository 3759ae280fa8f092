//! The log, which a debug probe shows: changes of state, faults, events, and once a second the operating point.

#[cfg(target_os = "none")]
mod text;

#[cfg(target_os = "none")]
pub use text::Log;

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
