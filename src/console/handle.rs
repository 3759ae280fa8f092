//! The two sides of the console: the drive that it commands, and the serial port.

use core::fmt::{self, Write};

use drive_core::learned::Learned;
use drive_core::{Accepted, Coefficients, Command, Refused};
use drive_settings::SettingsError;
use thiserror::Error;

use super::grammar::Level;
use crate::commissioning::Session;
use crate::link::Status;
use crate::link::ring::Record;
use crate::link::trace::{self, Plan};
use crate::rotor_tracking::Report;
use crate::settings::FirmwareSettings;
use crate::store::FlashError;
use crate::store::history::History;

/// Reason why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum CommandError {
    /// The drive refuses it.
    #[error("{0}")]
    Refused(Refused),
    /// The control interrupt does not run.
    #[error("the control does not run")]
    NoAnswer,
    /// It was not started, for this reason.
    #[error("the control does not run: {0}")]
    NotStarted(&'static str),
}

/// Access of the console to the drive and to the rest of the firmware.
pub trait DriveHandle {
    /// Gives the drive a command and waits for its answer, a few control periods at most.
    ///
    /// # Errors
    /// The drive refuses it, or does not answer.
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError>;
    /// Reason why there is no control.
    fn no_control(&self) -> CommandError;
    /// The last report of the control interrupt; `None` if there was none.
    fn status(&self) -> Option<Status>;
    /// Whether the outputs are off and stay off until the next command.
    fn is_off(&self) -> bool;
    /// Computes coefficients from settings. Takes seconds: only while the outputs are off.
    ///
    /// # Errors
    /// A value out of range, or a design rule that cannot be met.
    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError>;
    /// Notes that the drive has taken these settings.
    fn configured(&mut self, settings: &FirmwareSettings);
    /// State of the tracking of the rotor time constant, if it is enabled.
    fn tracking(&self) -> Option<Report>;
    /// The commissioning.
    fn session(&mut self) -> &mut Session;
    /// Saves the settings. Takes up to two erasures: only while the outputs are off.
    ///
    /// # Errors
    /// The flash failed.
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError>;
    /// Operating hours, starts and faults since the beginning.
    fn history(&self) -> &History;
    /// Starts a trace; `false`, and nothing changed, while one is being recorded.
    fn begin_trace(&mut self, plan: &Plan) -> bool;
    /// Ends a recording without a result.
    fn cancel_trace(&mut self);
    /// Whether a trace is being recorded.
    fn tracing(&self) -> bool;
    /// Record number `i` of the last trace, and its number from the record of the trigger.
    fn traced(&self, i: u16) -> Option<(i16, trace::Record)>;
    /// Asks for a record of each control period whose number is a multiple of `divider`, or of one of the next two; 0 ends it.
    fn stream(&mut self, divider: u16);
    /// The next record for the stream.
    fn sampled(&mut self) -> Option<Record>;
    /// Resets the chip. Only while the outputs are off.
    fn reboot(&mut self);
    /// Calls `show` with the result of a learning that ended since the last call, accepted or not.
    fn learned(&mut self, show: &mut dyn FnMut(&Learned));
    /// Sets how much is logged.
    fn set_log_level(&mut self, level: Level);
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
    /// Changes the bits per second as soon as all bytes are sent; `false` if that is still to come: call it again.
    fn change_rate(&mut self, baud: u32) -> bool;
}
