//! Shards that are merged.

use super::run::{self, Output, Run};
use crate::input::Input;
use crate::prelude::*;
use crate::shards;

/// Merges shards, prints the JSON object of the whole run, and writes its page and its CSV files where wanted.
///
/// # Errors
/// As [`shards::merge`]; [`Error::Write`]; [`Error::Lost`] after all is written.
pub fn merge(files: &[PathBuf], out: Option<PathBuf>, csv: Option<PathBuf>) -> Result<(), Error> {
    let merged = shards::merge(files)?;
    let input = Input { seed: merged.seed, quiet: true, ..Input::default() };
    let output = Output { out, json: true, csv };
    let name = merged.experiment.name;
    let run = Run {
        experiment: merged.experiment,
        input: &input,
        config: &merged.config,
        command: format!("run {name}"),
    };
    let object = run.write(&merged.outcome, &output)?;
    run::print(&[object], &output)?;
    run::check_lost(name, &merged.outcome)
}
