//! The command that merges shards.

use super::run::{self, Output, Run};
use crate::prelude::*;
use crate::shards::{self, Merged};

/// Merges shards, prints the JSON object of the whole run, and writes its page and its CSV files if requested.
///
/// # Errors
/// As [`shards::merge`]; [`Error::Write`]; [`Error::Lost`] after everything is written.
pub fn merge(files: &[PathBuf], out: Option<PathBuf>, csv: Option<PathBuf>) -> Result<(), Error> {
    let Merged { experiment, config, seed, outcome } = shards::merge(files)?;
    let input = Input { seed, quiet: true, ..Input::default() };
    let output = Output { out, json: true, csv };
    let command = format!("run {}", experiment.name);
    let run = Run { experiment, input: &input, config: &config, command };
    run::print(&[run.write(&outcome, &output)?], &output)?;
    run::check_lost(experiment.name, &outcome)
}
