//! The page of the settings lists the table of the settings.

use drive_settings::entry::Change;
use drive_settings::value::Value;

use super::FirmwareSettings;
use super::keys::{self, Key};

/// The row of a setting: name, unit, default, range, meaning.
fn row(key: Key) -> String {
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
    let (name, unit, help) = (key.name(), key.unit(), key.help());
    format!("| `{name}` | {unit} | {default} | {range} | {help}{change}{learned}{hardware} |")
}

/// On a difference the message is the table as it should be.
#[test]
fn the_manual_lists_the_settings_in_their_order() {
    let rows: Vec<String> = keys::all().map(row).collect();
    let manual = include_str!("../../docs/settings.md");
    let listed: Vec<&str> = manual.lines().filter(|line| line.starts_with("| `")).collect();
    assert!(listed == rows, "docs/settings.md has to list:\n{}", rows.join("\n"));
}
