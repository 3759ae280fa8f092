//! The pages in `docs/`: tables of the results of long runs, of motors and of experiments; links and anchors.
//!
//! A file `results/NAME.json` holds the numbers of one table with the measured commit and the commands. The ignored
//! test `measure` runs the commands of a file again and writes it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use hil_sim::Config;
use hil_sim::config::motors::Motor;
use hil_sim::experiments::{EXPERIMENTS, Experiment, WITH_INPUT};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::generated;

/// A table of measured numbers.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Results {
    /// The command that repeats it, as the page shows it.
    command: String,
    /// The measured commit of the program.
    commit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    seed: Option<u64>,
    /// Title of the table in the command's JSON from which the rows are taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    table: Option<String>,
    columns: Vec<Column>,
    /// Words that replace `{}` in the commands and the metrics of a row.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    keys: Vec<String>,
    /// Cells: texts, numbers, lists of numbers, or nothing.
    rows: Vec<Vec<Value>>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Column {
    name: String,
    /// Number of printed decimals, one for each number of a cell.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    digits: Vec<usize>,
    /// Its command, if it differs from the table's.
    #[serde(skip_serializing_if = "Option::is_none")]
    command: Option<String>,
    /// Metrics of the run, or the column of its table, from which a cell is taken.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    from: Vec<String>,
}

impl Results {
    fn read(path: &Path) -> Self {
        let text =
            fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
        serde_json::from_str(&text).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
    }

    /// Returns the file, with one line for each column and each row.
    fn text(&self) -> String {
        let mut head = serde_json::to_value(self).unwrap();
        for list in ["columns", "keys", "rows"] {
            head.as_object_mut().unwrap().remove(list);
        }
        let mut text = serde_json::to_string_pretty(&head).unwrap();
        text.truncate(text.trim_end_matches("\n}").len());
        let mut list = |name: &str, lines: Vec<String>| {
            write!(text, ",\n  \"{name}\": [\n    {}\n  ]", lines.join(",\n    ")).unwrap();
        };
        list("columns", self.columns.iter().map(|c| serde_json::to_string(c).unwrap()).collect());
        if !self.keys.is_empty() {
            list(
                "keys",
                vec![
                    self.keys.iter().map(|key| format!("\"{key}\"")).collect::<Vec<_>>().join(", "),
                ],
            );
        }
        list("rows", self.rows.iter().map(|row| serde_json::to_string(row).unwrap()).collect());
        text + "\n}\n"
    }

    /// Returns the table for the page, with its origin below.
    fn block(&self) -> String {
        let names: Vec<_> = self.columns.iter().map(|column| column.name.as_str()).collect();
        let mut text = format!("| {} |\n|{}\n", names.join(" | "), "---|".repeat(names.len()));
        for row in &self.rows {
            assert_eq!(row.len(), names.len(), "{row:?}");
            let cells: Vec<_> =
                row.iter().zip(&self.columns).map(|(cell, c)| c.printed(cell)).collect();
            writeln!(text, "| {} |", cells.join(" | ")).unwrap();
        }
        let seed = self.seed.map(|seed| format!(", seed {seed}")).unwrap_or_default();
        text + &format!("\n*Commit {}{seed}: `{}`*\n", self.commit, self.command)
    }

    /// Runs the commands and takes the numbers from their output.
    fn measure(&mut self) {
        let measured = self.columns.iter().any(|column| !column.from.is_empty());
        assert!(measured, "no column says what it is from: TABLE=FILE gives the rows");
        let mut ran = BTreeMap::new();
        let mut run = |command: &str| {
            let ran = ran.entry(command.to_owned()).or_insert_with(|| printed_json(command));
            ran.clone()
        };
        if let Some(title) = &self.table {
            let printed = run(&self.command);
            let tables = printed["table"].as_array().expect("tables");
            let table = tables.iter().find(|t| t["title"] == **title).expect("the table");
            let heads: Vec<_> = table["columns"].as_array().unwrap().iter().collect();
            let places: Vec<_> = self
                .columns
                .iter()
                .map(|column| {
                    heads.iter().position(|head| **head == column.from[0]).expect("the column")
                })
                .collect();
            let rows = table["rows"].as_array().unwrap().iter();
            self.rows = rows.map(|row| places.iter().map(|&n| row[n].clone()).collect()).collect();
        } else {
            for (row, key) in self.rows.iter_mut().zip(&self.keys) {
                for (cell, column) in row.iter_mut().zip(&self.columns) {
                    if !column.from.is_empty() {
                        let command = column.command.as_ref().unwrap_or(&self.command);
                        let metrics = &run(&command.replace("{}", key))["metrics"];
                        let of = |name: &String| metrics[name.replace("{}", key)].clone();
                        *cell = column.from.iter().map(of).collect();
                    }
                }
            }
        }
        for (cell, column) in self.rows.iter_mut().flat_map(|row| row.iter_mut().zip(&self.columns))
        {
            *cell = column.rounded(cell);
        }
        let commit = Command::new("git").args(["rev-parse", "--short", "HEAD"]).output().unwrap();
        self.commit = String::from_utf8(commit.stdout).unwrap().trim().to_owned();
    }
}

impl Column {
    /// Returns a number with the printed decimals; with all of them if the file does not state them.
    fn text(&self, n: usize, number: f64) -> String {
        match self.digits.get(n) {
            Some(&digits) => format!("{number:.digits$}"),
            None => number.to_string(),
        }
    }

    fn printed(&self, cell: &Value) -> String {
        let number = |(n, number): (usize, &Value)| match number.as_f64() {
            Some(number) => self.text(n, number).replace('-', "−"),
            None => number.as_str().unwrap_or("–").to_owned(),
        };
        match cell {
            Value::Null => String::new(),
            Value::Array(numbers) => {
                numbers.iter().enumerate().map(number).collect::<Vec<_>>().join(" / ")
            }
            one => number((0, one)),
        }
    }

    /// Rounds to the printed decimals; returns a single number instead of a list of one, and nothing if the run has no such number.
    fn rounded(&self, cell: &Value) -> Value {
        let round = |(n, number): (usize, &Value)| match number.as_f64() {
            Some(number) => self.text(n, number).parse::<f64>().unwrap().into(),
            None => number.clone(),
        };
        match cell {
            Value::Array(all) if all.iter().all(Value::is_null) => Value::Null,
            Value::Array(one) if one.len() == 1 => round((0, &one[0])),
            Value::Array(numbers) => numbers.iter().enumerate().map(round).collect(),
            one => round((0, one)),
        }
    }
}

/// Returns the JSON that `cargo sim ...` prints.
fn printed_json(command: &str) -> Value {
    let arguments = command.strip_prefix("cargo sim ").expect("a command of the simulator");
    println!("{command}");
    let mut sim = Command::new(env!("CARGO_BIN_EXE_hil-sim"));
    let sim = sim.args(arguments.split_whitespace()).args(["--json", "--quiet"]);
    let output = sim.current_dir(env!("CARGO_TARGET_TMPDIR")).output().unwrap();
    serde_json::from_slice(&output.stdout).unwrap_or_else(|why| {
        panic!("{command}: {why}: {}", String::from_utf8_lossy(&output.stderr))
    })
}

fn results() -> Vec<(String, PathBuf)> {
    let files = fs::read_dir(generated::root().join("results")).expect("the results");
    let mut files: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    files.sort();
    files
        .into_iter()
        .map(|path| (path.file_stem().unwrap().to_string_lossy().into_owned(), path))
        .collect()
}

/// Returns the pages of the book and the README, by their path from the folder of the repository.
fn pages() -> BTreeMap<String, String> {
    let docs = fs::read_dir(generated::root().join("docs")).expect("the pages");
    let names = docs.map(|file| format!("docs/{}", file.unwrap().file_name().to_string_lossy()));
    let names = names.filter(|name| name.ends_with(".md")).chain(["README.md".to_owned()]);
    names
        .map(|name| {
            let text = fs::read_to_string(generated::root().join(&name)).unwrap();
            (name, text)
        })
        .collect()
}

/// A table of results equals that of its file, if a page shows it; the lists equal those of the program.
#[test]
fn tables_of_the_pages_are_those_of_results_and_program() {
    let mine = |text: &String| {
        let blocks = text.split("<!-- generated: ").skip(1).map(str::to_owned);
        blocks.filter(|block| block.contains("-p hil-sim documents) -->")).collect::<Vec<_>>()
    };
    let mut known: Vec<_> = results().into_iter().map(|(name, _)| name).collect();
    known.extend(
        ["experiments", "motors-list", "injection", "budgets", "load-step"].map(str::to_owned),
    );
    for block in pages().values().flat_map(mine) {
        let name = block.split(' ').next().unwrap();
        assert!(known.iter().any(|known| known == name), "nothing renders the block {name}");
    }
    for (name, path) in results() {
        let marker = format!("<!-- generated: {name} (");
        let holds = |(_, text): &(_, String)| text.contains(&marker);
        let block = Results::read(&path).block();
        if let Some((page, _)) = pages().into_iter().find(holds) {
            generated::check(page.trim_start_matches("docs/"), &name, &block);
        }
    }
    let mut list = "| name | shows | stands for |\n|---|---|---|\n".to_owned();
    for experiment in EXPERIMENTS.iter().chain(&*WITH_INPUT) {
        let Experiment { name, about, stands_for, .. } = experiment;
        writeln!(list, "| `{name}` | {about} | {stands_for} |").unwrap();
    }
    generated::check("simulator.md", "experiments", &list);
    let mut list = "| name | motor | unverified |\n|---|---|---|\n".to_owned();
    for motor in Motor::all() {
        let unverified = motor
            .settings()
            .into_iter()
            .map(|(key, _)| key)
            .filter(|key| motor.source_of(key).is_some_and(|source| source.unverified));
        let unverified = unverified.map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", ");
        writeln!(list, "| `{}` | {} | {unverified} |", motor.name, motor.title).unwrap();
    }
    generated::check("motors.md", "motors-list", &list);
    let list = "| motor | injected voltage, V | current, A | of the rated current, % | q axis: torque ripple at rest, % | largest, % | angle error, rms / largest, ° | d axis: largest torque ripple, % | angle error, rms / largest, ° |\n\
                |---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    let list = list + &crate::injection_torque::rows();
    generated::check("performance.md", "injection", &list);
    let mut shaft = Results::read(&generated::root().join("results/shaft.json"));
    for row in &mut shaft.rows {
        let motor = row[0].as_str().unwrap().trim_matches('`').to_owned();
        let rated = f64::from(Config::of_motor(Some(&motor)).unwrap().drive.nameplate.speed_rpm);
        for n in [1, 2, 4, 5] {
            let drop = match &mut row[n] {
                Value::Array(numbers) => &mut numbers[0],
                one => one,
            };
            *drop = (100.0 * drop.as_f64().unwrap() / rated).into();
            let column = &mut shaft.columns[n];
            column.name = column.name.replace("rpm", "% of the rated speed");
            column.digits[0] = 1;
        }
    }
    generated::check("performance.md", "load-step", &shaft.block());
    let mut list = "| budget | limit |\n|---|---|\n".to_owned();
    for (file, unit) in [("xtask/budgets.toml", "cycles"), ("src/images/full.toml", "bytes")] {
        let budgets = fs::read_to_string(generated::root().join(file)).unwrap();
        let budgets: toml::Table = toml::from_str(&budgets).expect("the budgets");
        for (name, limit) in budgets[unit].as_table().unwrap() {
            writeln!(list, "| {} | {limit} {unit} |", name.replace('_', " ")).unwrap();
        }
    }
    generated::check("firmware.md", "budgets", &list);
}

/// Run with `RESULT=NAME cargo test --release -p hil-sim documents::measure -- --ignored --nocapture`. With
/// `TABLE=FILE` the rows are those of a Markdown table that another program has printed.
#[test]
#[ignore = "runs the commands of a file in results/; hours for some"]
fn measure() {
    let name = env::var("RESULT").expect("RESULT=NAME: a file of results/");
    let path = generated::root().join(format!("results/{name}.json"));
    let mut results = Results::read(&path);
    match env::var("TABLE") {
        Ok(table) => results.rows = rows_of(&fs::read_to_string(table).expect("TABLE")),
        Err(_) => results.measure(),
    }
    fs::write(path, results.text()).unwrap();
}

/// Returns the rows of the first table in a text, with numbers as numbers.
fn rows_of(text: &str) -> Vec<Vec<Value>> {
    let lines = text.lines().skip_while(|line| !line.contains("---|"));
    let rows = lines.skip(1).take_while(|line| line.contains('|'));
    let cell =
        |cell: &str| cell.trim().parse::<f64>().map_or_else(|_| cell.trim().into(), Value::from);
    rows.map(|row| row.trim().trim_matches('|').split('|').map(cell).collect()).collect()
}

/// Returns the anchor of a heading, which is the same on GitHub and with mdbook.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().trim().to_lowercase().replace(' ', "-")
}

/// Every link within the repository leads to a file, every anchor to a heading; every page is in the book, and linked from it.
#[test]
fn links_lead_somewhere() {
    let root = generated::root();
    let outside = [
        "CONTRIBUTING.md",
        "SECURITY.md",
        "CHANGELOG.md",
        "src/README.md",
        "drive-core/README.md",
        "hil-sim/README.md",
    ];
    let mut pages = pages();
    for name in outside {
        pages.insert(name.to_owned(), fs::read_to_string(root.join(name)).unwrap());
    }
    let anchors: BTreeMap<_, BTreeSet<_>> = pages
        .iter()
        .map(|(name, text)| {
            let headings = text.lines().filter(|line| line.starts_with('#'));
            (name, headings.map(|line| anchor(line.trim_start_matches('#'))).collect())
        })
        .collect();
    let mut wrong = Vec::new();
    for (name, text) in &pages {
        let text: String = text.split("```").step_by(2).collect();
        let text: String = text.split('`').step_by(2).collect();
        for link in
            text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(link, _)| link)
        {
            if link.contains("://") {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let folder = Path::new(name).parent().unwrap();
            let mut target = if path.is_empty() { PathBuf::from(name) } else { PathBuf::new() };
            if !path.is_empty() {
                for part in folder.join(path).components() {
                    match part.as_os_str().to_str().unwrap() {
                        ".." => {
                            target.pop();
                        }
                        part => target.push(part),
                    }
                }
            }
            let known = anchors.get(&target.to_string_lossy().into_owned());
            let found = known.is_none_or(|known| anchor.is_empty() || known.contains(anchor));
            if !root.join(&target).exists() || !found {
                wrong.push(format!("{name}: {link}"));
            }
        }
    }
    let book: toml::Table =
        toml::from_str(&fs::read_to_string(root.join("docs/book.toml")).unwrap()).unwrap();
    for (old, new) in book["output"]["html"]["redirect"].as_table().expect("the redirects") {
        let page = |address: &str| format!("docs/{}.md", address.trim_start_matches('/'));
        let (new, anchor) = new.as_str().unwrap().split_once(".html").expect("a page");
        let known = anchors.get(&page(new));
        if known.is_none_or(|known| !anchor.is_empty() && !known.contains(&anchor[1..])) {
            wrong.push(format!("docs/book.toml: {new}.html{anchor}"));
        }
        let (old, anchor) = old.split_once(".html").expect("a page");
        let remains = |known: &BTreeSet<_>| anchor.is_empty() || known.contains(&anchor[1..]);
        if anchors.get(&page(old)).is_some_and(remains) {
            wrong.push(format!("docs/book.toml: {old}{anchor} exists"));
        }
    }
    let summary = &pages["docs/SUMMARY.md"];
    let in_book = |name: &str| name == "SUMMARY.md" || summary.contains(&format!("({name})"));
    let docs = pages.keys().filter_map(|name| name.strip_prefix("docs/"));
    wrong.extend(
        docs.filter(|name| !in_book(name)).map(|name| format!("docs/{name} is not in the book")),
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Every developer task that a page or CONTRIBUTING names exists in `xtask`.
#[test]
fn tasks_of_the_pages_exist() {
    let root = generated::root();
    let [tasks, contributing] = ["xtask/src/main.rs", "CONTRIBUTING.md"]
        .map(|file| fs::read_to_string(root.join(file)).unwrap());
    let mut pages = pages();
    pages.insert("CONTRIBUTING.md".to_owned(), contributing);
    for (page, text) in pages {
        for rest in text.split("cargo xtask ").skip(1) {
            let task = rest.split(|c: char| c != '-' && !c.is_ascii_lowercase()).next().unwrap();
            let capital = |part: &str| part[..1].to_uppercase() + &part[1..];
            let name: String =
                task.split('-').filter(|part| !part.is_empty()).map(capital).collect();
            let is_task = |end: &str| tasks.contains(&format!("\n    {name}{end}"));
            assert!(
                name.is_empty() || [",", "(", " {"].iter().any(|end| is_task(end)),
                "{page}: cargo xtask {task}"
            );
        }
    }
}
