//! The table of the firmware's own settings, beside those of the drive.

use drive_settings::entry;
use drive_settings::entry::{Access, Change, Entry, Guard};
use drive_settings::value::Words;

use super::FirmwareSettings as Settings;
use super::bus::{Alive, Baud, Commander, Format};
use super::strip::{Enable, Reference, Start};
use crate::boards;

/// Name of the setting for the silence that stops the drive.
pub const TIMEOUT: &str = "command.timeout_s";

/// Name of the setting that identifies the board.
pub const BOARD: &str = "board";

/// The settings, in the order in which they are shown.
#[rustfmt::skip] // One setting, one row.
pub static OWN: [Entry<Settings>; 24] = [
    entry!(101: number("s"), TIMEOUT, [command] timeout_s: f32, "time without a valid line after which the drive stops; 0: never").from_to(0.0, 3600.0).guarded(Guard::Lower),
    entry!(132: number("s"), "stop.coasts_s", [command] coasts_s: f32, "longest time in which the shaft coasts to rest").from_to(0.0, 3600.0).guarded(Guard::Raise),
    entry!(102: word(), "wiring_checked", [command] wiring_checked: bool, "whether a start has checked the wiring since the defaults were set").guarded(Guard::Keep),
    entry!(103: word(), "console.echo", [command] echo: bool, "whether the console sends typed characters back"),
    entry!(104: word(), "bus.commands", [bus] commander: Commander, "who starts the drive and gives it references; anybody may stop it"),
    entry!(105: whole(), "bus.address", [bus] address: u32, "address of the drive on the bus").from_to(1.0, 247.0),
    entry!(106: word("bit/s"), "bus.baud", [bus] baud: Baud, "rate of the bus"),
    entry!(107: word(), "bus.parity", [bus] format: Format, "data bits, parity and stop bits of the bus"),
    entry!(131: word(), "bus.alive", [bus] alive: Alive, "requests that keep the master alive: commands, or any valid one").guarded(Guard::Lower),
    entry!(110: word(), "strip.enable", [strip] enable: Enable, "whether ENABLE must be closed; opening it takes the torque to zero, then switches off; now: off at once").guarded(Guard::Raise),
    entry!(111: word(), "strip.start", [strip] start: Start, "a switch at START starts and stops, or a button at START starts and one at STOP stops"),
    entry!(112: word(), "strip.reverse", [strip] reverse: bool, "whether REVERSE, closed at a start, turns the other way"),
    entry!(113: word(), "strip.reset", [strip] reset: bool, "whether closing RESET clears a latched fault"),
    entry!(114: word(), "strip.presets", [strip] presets: bool, "whether PRESET1 and PRESET2 select a preset speed"),
    entry!(115: whole(), "strip.preset_1_rpm", [strip] preset_1_rpm: u16, "speed with PRESET1 closed").from_to(0.0, 24_000.0),
    entry!(116: whole(), "strip.preset_2_rpm", [strip] preset_2_rpm: u16, "speed with PRESET2 closed").from_to(0.0, 24_000.0),
    entry!(117: whole(), "strip.preset_3_rpm", [strip] preset_3_rpm: u16, "speed with both closed").from_to(0.0, 24_000.0),
    entry!(118: word(), "strip.reference", [strip] reference: Reference, "source of the speed while no preset is selected"),
    entry!(119: whole(), "strip.reference_rpm", [strip] reference_rpm: u16, "speed at 20 mA or 10 V").from_to(0.0, 24_000.0),
    entry!(120: word(), "strip.outputs", [strip] outputs: bool, "whether the outputs RUN and FAULT are used"),
    entry!(121: word(), "strip.brake", [strip] brake: bool, "whether BRAKE opens a brake while the drive has torque, which each start proves").guarded(Guard::Keep),
    entry!(133: number("s"), "strip.brake_s", [strip] brake_s: f32, "closing time of the brake, for which a stop keeps the torque").from_to(0.01, 5.0).guarded(Guard::Keep),
    Entry::new(108, BOARD, "", Access::Word(
        |s: &Settings| boards::NAMES.iter().position(|name| *name == s.board.name).unwrap_or(0),
        |s, place| s.board = boards::ALL[place % boards::ALL.len()],
        &boards::NAMES,
    ), "board that the firmware is built for").changed(Change::Board),
    entry!(109: whole(), "board.confirmed", [command] confirmed: u32, "number of the confirmed board; `confirm board` sets it").from_to(0.0, 16_777_215.0).changed(Change::Board),
];
