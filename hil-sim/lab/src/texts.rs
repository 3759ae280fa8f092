//! The long texts of the experiments: the remarks and notes of `hil-sim/lab/texts.toml`.

use std::collections::HashMap;
use std::sync::LazyLock;

use serde::Deserialize;
use sim_bench::outcome::{Metrics, Outcome};

/// Texts of an experiment.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Texts {
    remarks: Vec<String>,
    /// Notes below tables, by name.
    notes: HashMap<String, String>,
}

/// The texts by the name of the experiment.
static TEXTS: LazyLock<HashMap<String, Texts>> = LazyLock::new(|| {
    toml::from_str(include_str!("../texts.toml")).expect("the texts are part of the program")
});

/// Adds the remarks of an experiment. A place gets the value of its name, or else the metric of its name.
///
/// # Panics
/// If the experiment has no texts: they are part of the program.
pub fn add_remarks(outcome: &mut Outcome, experiment: &str, values: &[(&str, f64)]) {
    let remarks = &TEXTS[experiment].remarks;
    outcome.remarks.extend(remarks.iter().map(|text| filled(text, values, &outcome.metrics)));
}

/// Returns the note `EXPERIMENT/NAME`.
///
/// # Panics
/// If there is no such note: they are part of the program.
pub fn note(name: &str, values: &[(&str, f64)]) -> String {
    let (experiment, name) = name.split_once('/').unwrap_or((name, ""));
    filled(&TEXTS[experiment].notes[name], values, &Metrics::default())
}

/// Fills the places `{NAME}` and `{NAME:.DIGITS}` of a text.
fn filled(text: &str, values: &[(&str, f64)], metrics: &Metrics) -> String {
    let mut filled = String::new();
    for (part, is_place) in text.split(['{', '}']).zip([false, true].into_iter().cycle()) {
        let (name, digits) = part.split_once(":.").unwrap_or((part, ""));
        let given = values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        let value = given.or_else(|| metrics.get(name)).unwrap_or(f64::NAN);
        filled += &match digits.parse::<usize>() {
            _ if !is_place => part.to_owned(),
            Ok(digits) => format!("{value:.digits$}"),
            Err(_) => value.to_string(),
        };
    }
    filled
}
