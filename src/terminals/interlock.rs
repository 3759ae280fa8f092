//! State of the terminals, as command arbiter and console see it: what keeps the drive from running.

use core::fmt;

use drive_core::{Fault, Stop};
use drive_settings::SettingsError;

use super::contacts::Contacts;
use super::reference::Lost;
use crate::settings::FirmwareSettings;

/// The state, see the head of the module.
#[derive(Default)]
pub struct Interlock {
    /// Closed contacts, and the contacts when they were last read.
    pub(super) closed: Contacts,
    /// See `closed`.
    pub(super) contacts: Contacts,
    /// Reason why the reference was lost, until that is cleared.
    pub(super) lost: Option<Lost>,
    /// Last reading of the motor's temperature sensor, °C.
    pub(super) motor_c: Option<Result<f32, Fault>>,
}

impl Interlock {
    /// Checks what depends on the board.
    ///
    /// # Errors
    /// The first setting that fails the check.
    pub fn check(settings: &FirmwareSettings) -> Result<(), SettingsError> {
        settings.modules.terminals.check(settings.board)
    }

    /// Time that the brake needs to close, s, if there is a brake.
    pub fn brake_s(settings: &FirmwareSettings) -> Option<f32> {
        let own = &settings.modules.terminals;
        own.brake.then_some(own.brake_s)
    }

    /// Reason why the drive must not run, if there is one. A contact that has just opened does not let it run.
    pub fn hold(&self, settings: &FirmwareSettings) -> Option<&'static str> {
        let closed = Contacts(self.closed.0 & self.contacts.0);
        settings.modules.terminals.interlock(closed).map(open)
    }

    /// Clears the lost reference, with the latched fault.
    pub fn clear(&mut self) {
        self.lost = None;
    }

    /// Temperature of the motor, °C, if its sensor is read.
    pub fn motor_c(&self) -> Option<Result<f32, Fault>> {
        self.motor_c
    }

    /// Writes closed contacts, an interlock and a lost reference.
    ///
    /// # Errors
    /// Those of the formatter.
    pub fn status(&self, settings: &FirmwareSettings, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let own = &settings.modules.terminals;
        if self.closed != Contacts::default() {
            write!(f, "; closed:{}", self.closed)?;
        }
        own.interlock(self.closed).map_or(Ok(()), |stop| write!(f, "; {}", open(stop)))?;
        self.lost.map_or(Ok(()), |why| write!(f, "; the reference is lost, {}", why.text()))
    }
}

/// The text for an open contact that causes this stop.
const fn open(stop: Stop) -> &'static str {
    match stop {
        Stop::Ramp => "the terminal strip holds the drive: STOP is open",
        _ => "the terminal strip holds the drive: ENABLE is open",
    }
}
