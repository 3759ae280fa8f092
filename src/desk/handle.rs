//! Access of the command arbiter to the drive.

use drive_core::learned::Learned;
use drive_core::{Accepted, Coefficients, Command, Refused};
use drive_settings::SettingsError;
use thiserror::Error;

use crate::commissioning::Session;
use crate::link::Status;
use crate::settings::FirmwareSettings;
use crate::settings::keys::Key;
use crate::store::FlashError;

/// Reason why a command was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum CommandError {
    /// The drive refuses it.
    Refused(Refused),
    /// The control interrupt does not run.
    NoAnswer,
    /// The control was not started, for this reason.
    NotStarted(&'static str),
}

/// Access of the command arbiter to the drive.
pub trait DriveHandle {
    /// Gives the drive a command and waits for its answer, a few control periods at most.
    ///
    /// # Errors
    /// The drive refuses it, or does not answer.
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError>;
    /// Reason why there is no control.
    fn no_control(&self) -> CommandError {
        CommandError::NoAnswer
    }
    /// The last report of the control interrupt; `None` if there was none.
    fn status(&self) -> Option<Status>;
    /// Whether the outputs are off and stay off until the next command.
    fn is_off(&self) -> bool;
    /// Whether the drive is stopping with the outputs on, as of the last control period.
    fn is_stopping(&self) -> bool {
        self.status().is_some_and(|status| status.state.is_stopping())
    }
    /// Computes coefficients from settings. Takes seconds: only while the outputs are off.
    ///
    /// # Errors
    /// A value out of range, or a design rule that cannot be met.
    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError>;
    /// Notes that the drive has taken these settings.
    fn configured(&mut self, settings: &FirmwareSettings);
    /// Connects the pins of the gates, because the board is the one that the image is for.
    fn connect(&mut self) {}
    /// Notes that this protective setting has another value now. Only while the outputs are off.
    fn changed(&mut self, _: Key) {}
    /// The commissioning.
    fn session(&mut self) -> &mut Session;
    /// Saves the settings. Takes up to two page erasures: only while the outputs are off.
    ///
    /// # Errors
    /// The flash failed.
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError>;
    /// Resets the chip, into ST's loader or the firmware. Only while the outputs are off.
    fn reboot(&mut self, loader: bool);
    /// Calls `show` with the result of a self-commissioning that ended since the last call, accepted or not.
    fn learned(&mut self, show: &mut dyn FnMut(&Learned));
}
