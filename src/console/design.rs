//! The design of the controllers.

use drive_core::Command;
use drive_settings::SettingsError;
use thiserror::Error;

use super::handle::{CommandError, DriveHandle};
use crate::settings::FirmwareSettings;

/// Reason why the drive has not taken settings.
#[derive(Error, Debug)]
pub(super) enum NotTaken {
    #[error("{0}; not in force, still staged")]
    Design(SettingsError),
    #[error(transparent)]
    Command(CommandError),
}

/// Designs the controllers for settings, and gives them to the drive. Once in the code: the coefficients take much stack.
#[inline(never)]
pub(super) fn configure(
    drive: &mut impl DriveHandle,
    settings: &mut FirmwareSettings,
) -> Result<(), NotTaken> {
    let taken = match drive.build(settings) {
        Ok(coefficients) => drive.command(Command::Configure(coefficients)),
        Err(why) => return Err(NotTaken::Design(why)),
    };
    taken.map(|_| ()).map_err(NotTaken::Command)
}
