//! What a valid line asks for.

use drive_commission::Step;
use drive_core::{Fault, Mode, Stop, homing};
use heapless::Vec;

use super::recording::Stream;
use crate::boards::Board;
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
    /// List all commands.
    Help,
    /// Show the state of the drive.
    Status,
    /// Put the staged settings in force, then start in a mode; to learn it is [`Learn`](Self::Learn).
    Start(Mode),
    /// Learn on the motor: anew, or again at another rotor position on top of what is learned.
    Learn {
        /// On top of it.
        again: bool,
    },
    /// Put the staged settings in force, then commission: these steps, the first and the last.
    Commission(Step, Step),
    /// Put in force what the commissioning has found, and save.
    Accept,
    /// Stop in this way.
    Stop(Stop),
    /// Magnetise again and check that the flux is tracked.
    Relock,
    /// Set the current on the quadrature axis, A.
    Torque(f32),
    /// Set the speed, mechanical rpm.
    Speed(f32),
    /// Turn at this speed, mechanical rpm, while it is repeated.
    Jog(f32),
    /// Set the position, mechanical turns from the start.
    Position(f32),
    /// Look for a stop of the shaft.
    Home(homing::Plan),
    /// Show one setting.
    Get(Key),
    /// List the settings whose names begin so.
    List(&'static str),
    /// List them as JSON.
    Describe(&'static str),
    /// Stage settings.
    Set(Assignments),
    /// Put the staged settings in force.
    Apply,
    /// Drop the staged settings.
    Revert,
    /// Put the staged settings in force and save all, with what was learned.
    Save,
    /// Stage the settings of the image.
    Defaults,
    /// List the lines that restore settings and learned values.
    Backup,
    /// List the result of the last learning.
    Learned,
    /// Words of a learned result, from this index on.
    Restore(usize, Vec<u32, WORDS_IN_LINE>),
    /// The checksum over all words of a learned result, which completes it.
    Restored(u32),
    /// Show the latched fault and the last reset, or the text of a fault.
    Faults(Option<Fault>),
    /// Show operating hours, starts and the last faults.
    History,
    /// Clear the latched fault.
    Clear,
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
    /// Send typed characters back, or not.
    Echo(bool),
    /// Reset the controller; whether unsaved settings may be lost.
    Reboot(bool),
    /// Show the board with its assumptions.
    Board,
    /// Check that what follows belongs to this board.
    BoardIs(&'static Board),
    /// Note that the bench steps of the board were done, and save.
    Confirm,
    /// Show the version of the firmware.
    Version,
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
    /// What the drive does, once a second, as well.
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
