//! Files of the single runs of a statistical experiment.

use crate::experiments;
use crate::journal::{self, Header, Journal};
use crate::prelude::*;

/// The files in which the single runs are stored.
#[derive(Args, Default)]
pub struct Records {
    /// Keep every finished run in this file, and do not repeat the runs that are there
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Write a CSV file with a row for each run: its random values and its results
    #[arg(long, value_name = "FILE")]
    rows: Option<PathBuf>,
}

impl Records {
    /// Runs the experiment, and stores its single runs if requested.
    ///
    /// # Errors
    /// The errors of the experiment; with one of these options, as [`experiments::statistical`], [`Journal::open`] and
    /// [`journal::runs`].
    pub fn run(
        &self,
        experiment: &Experiment,
        context: &Context<'_>,
        quiet: bool,
    ) -> Result<Outcome, Error> {
        if self.resume.is_none() && self.rows.is_none() {
            return experiment.run(context);
        }
        let statistical = experiments::statistical(experiment)?;
        let all = (statistical.runs)(context)?;
        let header = Header::new(experiment.name, context.config, context.seed, all)?;
        let journal = self.resume.as_ref().map(|path| Journal::open(path, &header)).transpose()?;
        if let Some(journal) = &journal {
            note(journal, all, quiet);
        }
        let runs = journal::runs(statistical, context, all, journal.as_ref())?;
        if let Some(path) = &self.rows {
            report::write_whole(path, &report::of_table(&journal::rows(&runs))?)?;
        }
        let records = runs.into_iter().map(|run| run.record).collect();
        let outcome = (statistical.outcome)(context, records)?;
        Ok(experiment.remarked(outcome, context.config))
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
