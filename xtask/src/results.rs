//! The age of the results of long runs, `results/*.json`: older ones were measured before their inputs changed.

use std::fs;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::files::files;
use crate::run;

/// Folders on which every result depends: control, plant, experiment. Comments in them do not count.
const INPUTS: &str = "drive-core/src drive-core/settings/src drive-core/commission/src drive-core/rotor-id/src hil-sim/plant/src \
                      hil-sim/bench/src hil-sim/lab/src hil-sim/src/experiments hil-sim/scenarios motors";

/// A result that is older than its inputs.
pub struct Outdated {
    /// Name of its file in `results/`.
    pub name: String,
    /// The command that repeats it.
    pub command: String,
    /// Whether its numbers are taken from the output of the command; otherwise somebody has to copy them.
    pub is_automatic: bool,
}

/// Finds the results whose commit is unknown or has other inputs than the current one.
pub fn outdated() -> Result<Vec<Outdated>> {
    let mut all = Vec::new();
    for file in files(&run::root().join("results"))? {
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let text = fs::read_to_string(&file)?;
        let json: Value = serde_json::from_str(&text).with_context(|| name.clone())?;
        let [commit, command] = ["commit", "command"].map(|key| json[key].as_str().unwrap_or(""));
        let shown = ["diff", "--unified=0", "--ignore-matching-lines=^ *//", commit, "HEAD", "--"];
        let diff: Vec<_> = shown.into_iter().chain(INPUTS.split_whitespace()).collect();
        if run::output("git", &diff).map_or(true, |changes| !changes.is_empty()) {
            let (command, is_automatic) = (command.to_owned(), text.contains("\"from\""));
            all.push(Outdated { name, command, is_automatic });
        }
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// Measures a result again, and writes its file.
pub fn renew(Outdated { name, .. }: &Outdated) -> Result<()> {
    let test = "test --release --package hil-sim --test simulator -- documents::measure --ignored";
    run::step(&format!("results/{name}.json"), run::cargo(test).env("RESULT", name))
}
