//! The tables of the firmware's own settings, beside those of drive and modules.

use drive_settings::entry;
use drive_settings::entry::{Access, Change, Entry};

use super::FirmwareSettings as Settings;
use crate::boards;

/// Declares the settings of a module, with their defaults, and their rows in the table of settings. A row is `NUMBER: KIND, NAME,
/// FIELD: TYPE = DEFAULT, MEANING;`, see `entry!`. The path is that of the module in [`FirmwareSettings`](super::FirmwareSettings).
macro_rules! settings {
    ($path:tt $($id:literal: $kind:ident($($unit:literal)?), $name:literal, $field:ident: $type:ty = $default:expr,
        $help:literal$(.$more:ident($($with:expr),+))*;)*) => {
        /// Settings of the module.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Settings { $(#[doc = $help] pub $field: $type,)* }

        impl Default for Settings {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        /// Their rows, in the order in which they are shown.
        pub static ROWS: &[drive_settings::entry::Entry<$crate::settings::FirmwareSettings>] = {
            #[allow(unused_imports)] // by a module without some kind of row
            use drive_settings::{entry::{Access, Entry, Guard}, value::Words};
            #[allow(unused_imports)]
            use $crate::settings::FirmwareSettings as Settings;
            &[$(drive_settings::entry!($id: $kind($($unit)?), $name, $path $field: $type, $help)$(.$more($($with),+))*),*]
        };
    };
}
pub(crate) use settings;

/// Name of the setting for the silence that stops the drive.
pub const TIMEOUT: &str = "command.timeout_s";

/// Name of the setting that identifies the board.
pub const BOARD: &str = "board";

/// The settings of the board, which come last.
#[rustfmt::skip]
pub static OF_BOARD: [Entry<Settings>; 2] = [
    Entry::new(108, BOARD, "", Access::Word(
        |s: &Settings| boards::NAMES.iter().position(|name| *name == s.board.name).unwrap_or(0),
        |s, place| s.board = boards::ALL[place % boards::ALL.len()],
        &boards::NAMES,
    ), "board that the firmware is built for").changed(Change::Board),
    entry!(109: whole(), "board.confirmed", [] confirmed: u32, "number of the confirmed board; `confirm board` sets it").from_to(0.0, 16_777_215.0).changed(Change::Board),
];
