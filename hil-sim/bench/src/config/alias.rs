//! Old names of settings, which stay accepted, and the values of a file as text.

use drive_settings::renamed::RENAMED;

/// Converts a name to its current name, and the text of its value to the value as [`super::Value`] shows it.
pub fn today(name: &str, text: &str) -> (String, String) {
    let now = RENAMED.iter().find(|(_, old)| *old == name).map_or(name, |(now, _)| now);
    (now.to_owned(), plain(text))
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
