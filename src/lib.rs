//! The firmware without its control interrupt and its main loop. All but the registers of the chip is tested and fuzzed on a host.
//!
//! Start reading at `main.rs`.
#![cfg_attr(not(test), no_std)]
// `new` is used in constants, where `Default` is not available.
#![allow(clippy::new_without_default)]

pub mod board;
pub mod boards;
#[cfg(target_os = "none")]
pub mod chip;
#[cfg(feature = "coefficients")]
pub mod coefficients;
pub mod commissioning;
pub mod console;
pub mod desk;
pub mod front;
mod hash;
pub mod history;
pub mod homing;
pub mod link;
pub mod log;
pub mod monitor;
pub mod recording;
pub mod rotor_tracking;
pub mod settings;
pub mod store;

// The modules that an image may leave out, by a feature each: the folder of a module, or the empty twin in it.
#[cfg(feature = "bus")]
pub mod modbus;
#[cfg(not(feature = "bus"))]
#[path = "modbus/without.rs"]
pub mod modbus;
#[cfg(feature = "terminals")]
pub mod terminals;
#[cfg(not(feature = "terminals"))]
#[path = "terminals/without.rs"]
pub mod terminals;

use drive_settings::entry::Entry;
use settings::{Commander, FirmwareSettings, command, own};

/// The tables of the firmware's own settings, in the order in which they are shown.
const OWN: [&[Entry<FirmwareSettings>]; 4] =
    [command::ROWS, modbus::ROWS, terminals::ROWS, &own::OF_BOARD];

/// Whether the image has the module of this commander.
const fn has(commander: Commander) -> bool {
    match commander {
        Commander::Console => true,
        Commander::Bus => !modbus::ROWS.is_empty(),
        Commander::Terminals => !terminals::ROWS.is_empty(),
    }
}

/// Settings of the modules.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModuleSettings {
    /// Settings of the field bus.
    pub bus: modbus::Settings,
    /// Settings of the terminals.
    pub terminals: terminals::Settings,
}

/// State of the modules that command arbiter and console look at: that of the terminals.
pub type ModuleState = terminals::Interlock;

/// The homing of the command arbiter.
pub type Homing = homing::Homing;

// The fuzz targets share a file of the tests, which names the library from outside.
#[cfg(test)]
extern crate self as induction_drive;
#[cfg(test)]
#[path = "../tests/common/generated.rs"]
mod generated;
