//! Experiments whose metrics have bounds: the rows of `bounds.toml`, each with its physics.

use std::collections::BTreeMap;

use hil_sim::{Config, experiments};
use rayon::prelude::*;
use serde::Deserialize;

/// A run of an experiment, with each of its seeds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    name: String,
    experiment: String,
    /// Motors, with each of which it runs; the dissertation's if there are none.
    #[serde(default)]
    motors: Vec<String>,
    /// Settings, or names of the table's sets.
    #[serde(default)]
    set: Vec<String>,
    /// Settings, with each of which it runs.
    #[serde(default)]
    each: Vec<String>,
    seeds: Vec<u64>,
    /// Whether it runs only with `cargo xtask prove long-tests`.
    #[serde(default)]
    long: bool,
    /// Metrics that are 0. In a name, `*` stands for any text; at least one metric fits.
    #[serde(default)]
    zero: Vec<String>,
    /// Metrics that are between these values, both included.
    #[serde(default)]
    within: BTreeMap<String, [f64; 2]>,
    /// Metrics that are not a number, because no run gives one.
    #[serde(default)]
    none: Vec<String>,
    /// Number of the faults that the outcome lists, and a text that each of them contains.
    faults: Option<usize>,
    #[serde(default)]
    fault: String,
}

#[derive(Deserialize)]
struct Table {
    /// Settings by name.
    sets: BTreeMap<String, Vec<String>>,
    run: Vec<Row>,
}

/// A run of a row: its motor, the setting of its own, and its seed.
type Run<'a> = (Option<&'a str>, Option<&'a str>, u64);

fn fits(name: &str, pattern: &str) -> bool {
    match pattern.split_once('*') {
        Some((begin, end)) => name.starts_with(begin) && name.ends_with(end),
        None => name == pattern,
    }
}

/// Returns each of the texts, or nothing once if there are none.
fn each(texts: &[String]) -> Vec<Option<&str>> {
    let all = texts.iter().map(|text| Some(text.as_str()));
    if texts.is_empty() { vec![None] } else { all.collect() }
}

impl Row {
    fn runs(&self) -> Vec<Run<'_>> {
        let (motors, settings) = (each(&self.motors), each(&self.each));
        let mut runs = Vec::new();
        for motor in motors {
            for own in &settings {
                runs.extend(self.seeds.iter().map(|seed| (motor, *own, *seed)));
            }
        }
        runs
    }

    /// Does a run; returns what is out of bounds.
    fn wrong(&self, sets: &BTreeMap<String, Vec<String>>, run: Run<'_>) -> Vec<String> {
        let (motor, own, seed) = run;
        let one = |set| sets.get(set).map_or(std::slice::from_ref(set), Vec::as_slice);
        let set = self.set.iter().flat_map(one).map(String::as_str);
        let set: Vec<&str> = set.chain(own).collect();
        let config = Config::load(motor, None, &set).expect(&self.name);
        let outcome = experiments::run(&self.experiment, &config, seed).expect(&self.name);
        let metrics: Vec<(&str, f64)> = outcome.metrics.iter().collect();
        let zero = self.zero.iter().map(|name| (name, [0.0, 0.0]));
        let none = self.none.iter().map(|name| (name, [f64::NAN; 2]));
        let within = self.within.iter().map(|(name, bounds)| (name, *bounds));
        let mut wrong = Vec::new();
        for (pattern, [least, most]) in zero.chain(none).chain(within) {
            let found = metrics.iter().filter(|(name, _)| fits(name, pattern));
            if found.clone().count() == 0 {
                wrong.push(format!("no {pattern}"));
            }
            let is_in =
                |value: f64| (least..=most).contains(&value) || least.is_nan() && value.is_nan();
            let out = found.filter(|(_, value)| !is_in(*value));
            wrong.extend(
                out.map(|(name, value)| format!("{name} = {value}, not {least} to {most}")),
            );
        }
        let faults = &outcome.faults;
        if self.faults.is_some_and(|count| count != faults.len())
            || faults.iter().any(|fault| !fault.contains(&self.fault))
        {
            wrong.push(format!("{faults:?}"));
        }
        wrong.iter().map(|wrong| format!("{}, {run:?}: {wrong}", self.name)).collect()
    }
}

/// Runs the rows that are long, or the others.
fn all_are_within_their_bounds(long: bool) {
    let table: Table = toml::from_str(include_str!("bounds.toml")).expect("the table");
    let rows = table.run.iter().filter(|row| row.long == long);
    let runs: Vec<_> =
        rows.flat_map(|row| row.runs().into_iter().map(move |run| (row, run))).collect();
    let wrong: Vec<String> =
        runs.par_iter().flat_map(|(row, run)| row.wrong(&table.sets, *run)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_experiment_is_within_its_bounds() {
    all_are_within_their_bounds(false);
}

#[test]
#[ignore = "cargo xtask prove long-tests"]
fn every_long_experiment_is_within_its_bounds() {
    all_are_within_their_bounds(true);
}
