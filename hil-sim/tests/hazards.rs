//! The page of the hazards: its tables, made from `hazards.toml`, and the existence of each proof and file that they name.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::generated;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hazards {
    group: Vec<Group>,
    item: Vec<Item>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    name: String,
    #[serde(default)]
    row: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    hazard: String,
    by: String,
    /// Reaction that replaces the times of the classes, or precedes them.
    reaction: Option<String>,
    #[serde(default)]
    classes: Vec<String>,
    #[serde(default)]
    tests: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Item {
    item: String,
    state: State,
    how: String,
    #[serde(default)]
    files: Vec<String>,
    #[serde(default)]
    classes: Vec<String>,
    #[serde(default)]
    tests: Vec<String>,
}

#[derive(Deserialize)]
enum State {
    #[serde(rename = "done")]
    Done,
    #[serde(rename = "partly")]
    Partly,
    #[serde(rename = "not done")]
    NotDone,
    /// There is no such part.
    #[serde(rename = "none")]
    Absent,
}

/// Returns the table of the fault campaign, with one row for each class.
fn campaign() -> Vec<Vec<Value>> {
    let text = fs::read_to_string(generated::root().join("results/campaign.json")).unwrap();
    serde_json::from_value(serde_json::from_str::<Value>(&text).unwrap()["rows"].clone()).unwrap()
}

/// Returns the bound, the longest time under wrong control and the latest switch-off of these classes, ms.
fn times(classes: &[String], campaign: &[Vec<Value>]) -> String {
    let mut worst = [0.0_f64; 3];
    for class in classes {
        let row = campaign.iter().find(|row| row[0] == **class);
        let row = row.unwrap_or_else(|| panic!("the campaign has no class {class}"));
        let bound = row[1].as_str().unwrap().parse().unwrap();
        let cells = row[2..].iter().filter_map(Value::as_array);
        let seen = |n: usize| cells.clone().filter_map(|cell| cell[n].as_f64()).fold(0.0, f64::max);
        for (worst, time) in worst.iter_mut().zip([bound, seen(3), seen(2)]) {
            *worst = worst.max(time);
        }
    }
    let text = |time: f64| if time.is_finite() { time.to_string() } else { "none".into() };
    if classes.is_empty() { String::new() } else { worst.map(text).join(" / ") }
}

/// Collects the names of the functions of all tests, and of the files of `tests/sessions`.
fn functions(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() && name != "target" && !name.to_string_lossy().starts_with('.') {
            functions(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let tests = text.split("#[test]").skip(1).filter_map(|rest| rest.split_once("fn "));
            found.extend(tests.filter_map(|(_, rest)| Some(rest.split_once('(')?.0.to_owned())));
        } else if let Some((_, name)) = path.to_string_lossy().split_once("/tests/sessions/") {
            found.insert(name.to_owned());
        }
    }
}

fn proof(classes: &[String], tests: &[String]) -> String {
    let class = classes.iter().map(|class| format!("*{class}*"));
    let test = tests.iter().map(|test| match test.ends_with(".txt") {
        true => format!("[`{test}`](../tests/sessions/{test})"),
        false => format!("`{test}`"),
    });
    class.chain(test).collect::<Vec<_>>().join("; ")
}

#[test]
fn the_page_of_the_hazards_names_what_proves_it() {
    let root = generated::root();
    let Hazards { group, item } = toml::from_str(include_str!("hazards.toml")).unwrap();
    let campaign = campaign();

    let mut table = String::new();
    for Group { name, row } in &group {
        write!(table, "### {name}\n\n").unwrap();
        if row.is_empty() {
            table += "Not built.\n\n";
            continue;
        }
        table += "| hazard | detection | reaction | proof |\n|---|---|---|---|\n";
        for Row { hazard, by, reaction, classes, tests } in row {
            let times = times(classes, &campaign);
            let times = reaction.iter().cloned().chain((!classes.is_empty()).then_some(times));
            let times = times.collect::<Vec<_>>().join("; ");
            writeln!(table, "| {hazard} | {by} | {times} | {} |", proof(classes, tests)).unwrap();
        }
        table += "\n";
    }
    generated::check("safety-evidence.md", "hazards", &table);

    let mut table = "| item | state | by | file | proof |\n|---|---|---|---|---|\n".to_owned();
    for Item { item, state, how, files, classes, tests } in &item {
        times(classes, &campaign);
        let missing: Vec<_> = files.iter().filter(|file| !root.join(file).is_file()).collect();
        assert!(missing.is_empty(), "{item}: {missing:?}");
        let word = match state {
            State::Done => "done",
            State::Partly => "partly",
            State::NotDone => "**not done**",
            State::Absent => "none",
        };
        let files: Vec<_> = files.iter().map(|f| format!("[`{f}`](../{f})")).collect();
        writeln!(
            table,
            "| {item} | {word} | {how} | {} | {} |",
            files.join(", "),
            proof(classes, tests)
        )
        .unwrap();
    }
    generated::check("safety-evidence.md", "class-b", &table);

    let mut known = BTreeSet::new();
    functions(&root, &mut known);
    let rows = || group.iter().flat_map(|group| &group.row);
    let named = rows().flat_map(|row| &row.tests).chain(item.iter().flat_map(|item| &item.tests));
    let missing: Vec<_> = named.filter(|test| !known.contains(*test)).collect();
    assert!(missing.is_empty(), "no such test: {missing:?}");
    let classes: BTreeSet<_> = rows().flat_map(|row| &row.classes).collect();
    for row in &campaign {
        let class = row[0].as_str().unwrap();
        let is_fault = class != "nothing (for comparison)";
        assert!(!is_fault || classes.iter().any(|c| *c == class), "{class} is proof of no hazard");
    }
}
