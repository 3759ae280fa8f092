//! A part of the runs of a statistical experiment, and continued runs.

use super::say;
use crate::experiments;
use crate::prelude::*;
use crate::shards::{self, Header, Journal, Shard};

/// Selection of the runs, and the place where they are stored.
#[derive(Args, Default)]
pub struct Part {
    /// Do only every Nth run, starting with the Ith, and print them in the form of a file for --resume
    #[arg(long, value_name = "I/N", conflicts_with_all = ["out", "csv", "json"])]
    shard: Option<Shard>,
    /// Keep every finished run in this file, or in its own file in this folder, and do not repeat the runs that are
    /// there: those of all shards whose files are in the folder count
    #[arg(long, value_name = "PATH")]
    resume: Option<PathBuf>,
    /// Write a CSV file with a row for each run: its random values and its results
    #[arg(long, value_name = "FILE")]
    rows: Option<PathBuf>,
}

impl Part {
    /// Runs the experiment. Prints the runs of a shard, or returns the outcome of all.
    ///
    /// # Errors
    /// The errors of the experiment; with options of this part, as [`experiments::statistical`], [`Journal::open`] and
    /// [`shards::runs`].
    pub fn run(
        &self,
        experiment: &Experiment,
        context: &Context<'_>,
        quiet: bool,
    ) -> Result<Option<Outcome>, Error> {
        if self.shard.is_none() && self.resume.is_none() && self.rows.is_none() {
            return experiment.run(context).map(Some);
        }
        let statistical = experiments::statistical(experiment)?;
        let shard = self.shard.unwrap_or(Shard::WHOLE);
        let all = (statistical.runs)(context)?;
        let header = Header::new(experiment.name, context.config, context.seed, all)?;
        let open = |path: &PathBuf| Journal::open(path, shard, &header);
        let journal = self.resume.as_ref().map(open).transpose()?;
        if let Some(journal) = &journal {
            note(journal, all, quiet);
        }
        let runs = shards::runs(statistical, context, shard.numbers(all), journal.as_ref())?;
        if let Some(path) = &self.rows {
            report::write_whole(path, &report::of_table(&shards::rows(&runs))?)?;
        }
        if self.shard.is_some() {
            say(shards::text(&header, &runs)?)?;
            return Ok(None);
        }
        let records = runs.into_iter().map(|run| run.record).collect();
        let outcome = (statistical.outcome)(context, records)?;
        Ok(Some(experiment.remarked(outcome, context.config)))
    }
}

/// Prints the state of a journal on standard error. A torn line is reported even in quiet mode.
fn note(journal: &Journal, all: usize, quiet: bool) {
    let path = message(journal.path.display());
    if let Some(line) = journal.torn {
        eprintln!("note: {path}, line {line}, was torn; its run is done again");
    }
    let done = journal.runs.len();
    if done > 0 && !quiet {
        eprintln!("note: {done} of {all} runs are stored already");
    }
}
