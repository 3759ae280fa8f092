//! Old names of keys, which stay accepted.

use drive_settings::renamed::RENAMED;

use super::DRIVE;

/// Old names, the current names, and the conversion to the current value.
type Alias = (&'static str, &'static str, fn(String) -> String);

static ALIASES: [Alias; 11] = [
    ("motor.rs", "motor.r_s", same),
    ("motor.rr", "motor.r_r", same),
    ("motor.lls", "motor.l_ls", same),
    ("motor.llr", "motor.l_lr", same),
    ("motor.lm", "motor.l_m", same),
    ("inverter.vdc", "inverter.dc_link_v", same),
    ("inverter.dead_time_us", "inverter.dead_time_s", micro),
    ("angle.source", "angle_source", same),
    ("angle.compensate_delays", "ignore_delays", negated),
    ("reference.id_a", "sequence.i_d", same),
    ("drive.learn", "prepare.learn", same),
];

/// Converts a name to its current name, and the text of its value to the current value as [`super::Value`] shows it.
pub fn today(name: &str, text: &str) -> (String, String) {
    // The drive has the names of the motor as well.
    let of_drive = name.starts_with("drive.motor.");
    let (prefix, bare) = name.split_at(if of_drive { DRIVE.len() } else { 0 });
    let (now, value) = match ALIASES.iter().find(|(old, ..)| *old == bare) {
        Some((_, now, of)) => (*now, of(plain(text))),
        None => {
            let renamed = RENAMED.iter().find(|(_, old)| *old == bare);
            (renamed.map_or(bare, |(now, _)| now), plain(text))
        }
    };
    (format!("{prefix}{now}"), value)
}

/// Returns the text of a value without what only its source needs: trailing zeros, quotation marks of a word. A number in quotation marks
/// keeps them, because it is none in TOML.
fn plain(text: &str) -> String {
    match (text.trim(), text.trim().trim_matches('"')) {
        ("true", _) => "yes".to_owned(),
        ("false", _) => "no".to_owned(),
        (text, word) => match (text.parse::<f64>(), word.parse::<f64>()) {
            (Ok(number), _) => number.to_string(),
            (_, Ok(_)) => text.to_owned(),
            _ => word.to_owned(),
        },
    }
}

fn same(value: String) -> String {
    value
}

fn micro(value: String) -> String {
    value.parse::<f64>().map_or(value, |us| (us * 1e-6).to_string())
}

fn negated(value: String) -> String {
    match value.as_str() {
        "yes" => "no".to_owned(),
        "no" => "yes".to_owned(),
        _ => value,
    }
}
