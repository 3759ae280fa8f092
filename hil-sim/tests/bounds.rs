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
    /// Settings, or names of the table's sets.
    #[serde(default)]
    set: Vec<String>,
    seeds: Vec<u64>,
    /// Metrics that are 0. In a name, `*` stands for any text; at least one metric fits.
    #[serde(default)]
    zero: Vec<String>,
    /// Metrics that are between these values, both included.
    #[serde(default)]
    within: BTreeMap<String, [f64; 2]>,
    /// Number of the faults that the outcome lists.
    faults: Option<usize>,
}

#[derive(Deserialize)]
struct Table {
    /// Settings by name.
    sets: BTreeMap<String, Vec<String>>,
    run: Vec<Row>,
}

fn fits(name: &str, pattern: &str) -> bool {
    match pattern.split_once('*') {
        Some((begin, end)) => name.starts_with(begin) && name.ends_with(end),
        None => name == pattern,
    }
}

impl Row {
    /// Runs it; returns what is out of bounds.
    fn wrong(&self, sets: &BTreeMap<String, Vec<String>>, seed: u64) -> Vec<String> {
        let one = |set| sets.get(set).map_or(std::slice::from_ref(set), Vec::as_slice);
        let set: Vec<&String> = self.set.iter().flat_map(one).collect();
        let config = Config::load(None, None, &set).expect(&self.name);
        let outcome = experiments::run(&self.experiment, &config, seed).expect(&self.name);
        let metrics: Vec<(&str, f64)> = outcome.metrics.iter().collect();
        let zero = self.zero.iter().map(|name| (name, [0.0, 0.0]));
        let mut wrong = Vec::new();
        for (pattern, [least, most]) in zero.chain(self.within.iter().map(|(n, is)| (n, *is))) {
            let found = metrics.iter().filter(|(name, _)| fits(name, pattern));
            if found.clone().count() == 0 {
                wrong.push(format!("no {pattern}"));
            }
            let is_out = |value: f64| !(least..=most).contains(&value);
            let out = found.filter(|(_, value)| is_out(*value));
            wrong.extend(
                out.map(|(name, value)| format!("{name} = {value}, not {least} to {most}")),
            );
        }
        if self.faults.is_some_and(|faults| faults != outcome.faults.len()) {
            wrong.push(format!("{:?}", outcome.faults));
        }
        wrong.iter().map(|wrong| format!("{}, seed {seed}: {wrong}", self.name)).collect()
    }
}

#[test]
fn every_experiment_is_within_its_bounds() {
    let table: Table = toml::from_str(include_str!("bounds.toml")).expect("the table");
    let runs: Vec<_> =
        table.run.iter().flat_map(|row| row.seeds.iter().map(move |seed| (row, *seed))).collect();
    let wrong: Vec<String> =
        runs.par_iter().flat_map(|(row, seed)| row.wrong(&table.sets, *seed)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
