//! The terminals left out of an image: the same names, without values and without work.

use core::fmt;

use drive_core::Fault;
use drive_settings::SettingsError;

use crate::desk::Desk;
use crate::settings::FirmwareSettings;
use crate::settings::own::settings;

settings! { [modules.terminals] }

/// No state.
#[derive(Default)]
pub struct Interlock {}

#[allow(missing_docs, clippy::missing_errors_doc)] // as in the module
#[rustfmt::skip] // one function, one line
impl Interlock {
    pub fn check(_: &FirmwareSettings) -> Result<(), SettingsError> { Ok(()) }
    pub fn brake_s(_: &FirmwareSettings) -> Option<f32> { None }
    pub fn hold(&self, _: &FirmwareSettings) -> Option<&'static str> { None }
    pub fn clear(&mut self) {}
    pub fn motor_c(&self) -> Option<Result<f32, Fault>> { None }
    pub fn status(&self, _: &FirmwareSettings, _: &mut fmt::Formatter<'_>) -> fmt::Result { Ok(()) }
}

/// Pins that nobody reads.
pub struct Pins;

impl Pins {
    /// No pins, and no ADC.
    pub fn new<A, B, C, R>(_: A, _: B, _: &C, _: &mut R) -> Self {
        Self
    }
}

/// Any port, since none is used.
pub trait Port {}
impl<T> Port for T {}

/// No terminals.
#[derive(Default)]
pub struct Terminals {}

#[allow(missing_docs)] // as in the module
impl Terminals {
    pub fn read_motor<P, D>(&self, _: &P, _: &mut Desk, _: &mut D, _: u32) {}
    pub fn serve<P, D>(&mut self, _: &mut P, _: &mut Desk, _: &mut D, _: u32) {}
}
