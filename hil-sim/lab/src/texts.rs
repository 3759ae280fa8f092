//! The texts of the experiments, from `hil-sim/lab/texts.toml`: remarks, captions of figures, titles and notes of tables.

use std::collections::HashMap;
use std::sync::LazyLock;

use serde::Deserialize;
use sim_bench::outcome::{Figure, Metrics, Outcome, Table};

/// Texts of an experiment.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Texts {
    remarks: Vec<String>,
    tables: HashMap<String, TableText>,
    figures: HashMap<String, FigureText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TableText {
    title: String,
    #[serde(default)]
    note: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FigureText {
    title: String,
    /// The part of the source that the figure reproduces.
    #[serde(default)]
    source: String,
}

/// The texts by the name of the experiment.
static TEXTS: LazyLock<HashMap<String, Texts>> = LazyLock::new(|| {
    toml::from_str(include_str!("../texts.toml")).expect("the texts are part of the program")
});

/// Adds the remarks of an experiment. A place gets the value of its name, or else the metric of its name.
///
/// # Panics
/// If the experiment has no texts, or a place no value: the texts are part of the program.
pub fn add_remarks(outcome: &mut Outcome, experiment: &str, values: &[(&str, f64)]) {
    let remarks = &TEXTS[experiment].remarks;
    outcome.remarks.extend(remarks.iter().map(|text| filled(text, values, &outcome.metrics)));
}

/// Makes a table of an experiment, without rows.
///
/// # Panics
/// If the experiment has no such table: the texts are part of the program.
pub fn table(experiment: &str, name: &str) -> Table {
    table_with(experiment, name, &[])
}

/// Makes a table of an experiment, without rows, with these values at the places of its title and its note.
///
/// # Panics
/// As [`table`], or if a place has no value.
pub fn table_with(experiment: &str, name: &str, values: &[(&str, f64)]) -> Table {
    let TableText { title, note } = &TEXTS[experiment].tables[name];
    let text = |text| filled(text, values, &Metrics::default());
    Table::new(text(title), &[]).note(text(note))
}

/// Makes a figure of an experiment, without panels.
///
/// # Panics
/// If the experiment has no such figure: the texts are part of the program.
pub fn figure(experiment: &str, name: &str) -> Figure {
    let FigureText { title, source } = &TEXTS[experiment].figures[name];
    Figure::new(name, title, source)
}

/// Fills the places `{NAME}` and `{NAME:.DIGITS}` of a text.
fn filled(text: &str, values: &[(&str, f64)], metrics: &Metrics) -> String {
    let mut filled = String::new();
    for (part, is_place) in text.split(['{', '}']).zip([false, true].into_iter().cycle()) {
        let (name, digits) = part.split_once(":.").unwrap_or((part, ""));
        let given = values.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        let value = || given.or_else(|| metrics.get(name)).expect(name);
        filled += &match digits.parse::<usize>() {
            _ if !is_place => part.to_owned(),
            Ok(digits) => format!("{:.digits$}", value()),
            Err(_) => value().to_string(),
        };
    }
    filled
}
