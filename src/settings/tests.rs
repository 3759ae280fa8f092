//! The page of the settings lists the table of the settings.

use drive_settings::entry::Change;
use drive_settings::value::Value;

use super::FirmwareSettings;
use super::keys::{self, Key};
use crate::generated;
use crate::modbus::registers::SETTINGS;

/// The row of a setting: name, register, unit, default, range, meaning.
fn row(key: Key) -> String {
    let register = SETTINGS + 2 * key.id();
    let settings = FirmwareSettings::of_the_board();
    let (value, number) = (key.get(&settings), key.number(&settings));
    let default = match (value, number) {
        (Value::Auto, Some(number)) => format!("auto: {number}"),
        _ => value.to_string(),
    };
    let range = match key.range(&settings) {
        Some((min, max)) => format!("{min} to {max}"),
        None => key.words().join(", "),
    };
    let change = match key.change() {
        Change::WhileOff => "",
        Change::FromReset => "; from the next reset on, if saved",
        Change::Board => "; of the board",
    };
    let learned = if key.learned() { "; **L**" } else { "" };
    let hardware = if key.hardware() { "; **H**" } else { "" };
    let guards = if key.guards() { "; **P**" } else { "" };
    let (name, unit, help) = (key.name(), key.unit(), key.help());
    format!(
        "| `{name}` | {register:04X} | {unit} | {default} | {range} | {help}{change}{learned}{hardware}{guards} |"
    )
}

#[test]
fn the_manual_lists_the_settings_in_their_order() {
    let head =
        "| key | register | unit | default | range | |\n|---|---|---|---|---|---|\n".to_owned();
    let table = keys::all().fold(head, |table, key| table + &row(key) + "\n");
    generated::check("settings.md", "settings", &table);
}
