//! All experiments on one page.

use std::path::Path;
use std::sync::Mutex;

use rayon::prelude::*;

use super::run::Run;
use super::{say, used};
use crate::error::Error;
use crate::experiments::{Context, EXPERIMENTS, Experiment};
use crate::input::Input;
use crate::outcome::{Origin, Outcome};
use crate::progress::Bar;
use crate::report;

/// Shows which experiments are running.
struct Running<'a> {
    bar: &'a Bar,
    names: Mutex<Vec<&'static str>>,
}

impl Running<'_> {
    fn change(&self, change: impl FnOnce(&mut Vec<&'static str>)) {
        // A panic elsewhere ends the program anyway.
        if let Ok(mut names) = self.names.lock() {
            change(&mut names);
            self.bar.label(&names.join(", "));
        }
    }

    fn run(&self, experiment: &'static Experiment, context: &Context<'_>) -> Outcome {
        self.change(|names| names.push(experiment.name));
        let outcome = (experiment.run)(context).unwrap_or_else(|error| Outcome::refused(&error));
        self.change(|names| names.retain(|name| *name != experiment.name));
        self.bar.advance(1);
        outcome
    }
}

/// Runs all experiments into one page. One that is refused or lost is named in the page and on standard error.
///
/// # Errors
/// As [`Input::config`] and [`used::check`]; [`Error::Write`]; [`Error::Incomplete`] after the page is written.
pub fn report(input: &Input, out: &Path) -> Result<(), Error> {
    let config = input.config()?;
    used::check("report", &EXPERIMENTS.iter().collect::<Vec<_>>(), input)?;
    let context = Context {
        config: &config,
        seed: input.seed,
        seconds: config.extent.seconds,
        progress: input.progress(),
        file: None,
    };
    let bar = context.progress.bar("report", EXPERIMENTS.len() as u64);
    let running = Running { bar: &bar, names: Mutex::default() };
    let outcomes: Vec<Outcome> =
        EXPERIMENTS.par_iter().map(|experiment| running.run(experiment, &context)).collect();
    drop(bar);

    let run = |experiment: &'static Experiment| Run {
        experiment,
        input,
        config: &config,
        command: format!("run {}", experiment.name),
    };
    let runs: Vec<_> = EXPERIMENTS.iter().map(run).collect();
    let sections: Vec<_> =
        runs.iter().zip(&outcomes).map(|(run, outcome)| run.section(outcome)).collect();
    let origin = Origin::new(input.seed, &config.changes());
    let path = out.join("report.html");
    let page = report::page("Induction drive: all experiments", &origin, &sections)?;
    report::write_whole(&path, &page)?;
    say(&format!("Report: {}\n", path.display()))?;

    let mut names = Vec::new();
    for (experiment, outcome) in EXPERIMENTS.iter().zip(&outcomes) {
        if let Some(reason) = outcome.lost() {
            eprintln!("{}: {reason}", experiment.name);
            names.push(experiment.name.to_owned());
        }
    }
    match names.len() {
        0 => Ok(()),
        failed => Err(Error::Incomplete { failed, all: EXPERIMENTS.len(), names }),
    }
}
