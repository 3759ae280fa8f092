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

    fn run(&self, experiment: &Experiment, context: &Context<'_>) -> Outcome {
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
    report_of(EXPERIMENTS, input, out)
}

fn report_of(experiments: &[Experiment], input: &Input, out: &Path) -> Result<(), Error> {
    let config = input.config()?;
    used::check("report", &experiments.iter().collect::<Vec<_>>(), input)?;
    let context = Context {
        config: &config,
        seed: input.seed,
        seconds: config.extent.seconds,
        progress: input.progress(),
        file: None,
    };
    let bar = context.progress.bar("report", experiments.len() as u64);
    let running = Running { bar: &bar, names: Mutex::default() };
    let outcomes: Vec<Outcome> =
        experiments.par_iter().map(|experiment| running.run(experiment, &context)).collect();
    drop(bar);

    let run = |experiment: &'_ Experiment| format!("run {}", experiment.name);
    let runs: Vec<_> = experiments
        .iter()
        .map(|experiment| Run { experiment, input, config: &config, command: run(experiment) })
        .collect();

    let sections: Vec<_> =
        runs.iter().zip(&outcomes).map(|(run, outcome)| run.section(outcome)).collect();
    let origin = Origin::new(input.seed, &config.changes());
    let path = out.join("report.html");
    let page = report::page("Induction drive: all experiments", &origin, &sections)?;
    report::write_whole(&path, &page)?;
    say(&format!("Report: {}\n", path.display()))?;

    let mut names = Vec::new();
    for (experiment, outcome) in experiments.iter().zip(&outcomes) {
        if let Some(reason) = outcome.lost() {
            eprintln!("{}: {reason}", experiment.name);
            names.push(experiment.name.to_owned());
        }
    }
    match names.len() {
        0 => Ok(()),
        failed => Err(Error::Incomplete { failed, all: experiments.len(), names }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn experiment(
        name: &'static str,
        run: fn(&Context<'_>) -> Result<Outcome, Error>,
    ) -> Experiment {
        Experiment { name, stands_for: "a test", about: "A test.", uses: &[], not: &[], run }
    }

    #[test]
    fn a_report_goes_on_when_experiments_are_refused_or_lost() {
        let experiments = [
            experiment("refused", |_| Err(Error::Refused("dc link too low".into()))),
            experiment("sound", |_| {
                let mut outcome = Outcome::default();
                outcome.metrics.set("torque_nm", 0.625);
                Ok(outcome)
            }),
            experiment("lost", |_| {
                let faults = vec!["fault 12: the flux angle is lost".to_owned()];
                Ok(Outcome { faults, ..Outcome::default() })
            }),
        ];
        let folder = std::env::temp_dir().join(format!("hil-sim-report-{}", std::process::id()));
        let error = report_of(&experiments, &Input::default(), &folder).unwrap_err();
        assert_eq!(error.to_string(), "2 of 3 experiments failed: refused, lost");
        assert_eq!(error.exit_code(), 1);
        let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
        for part in ["Refused: dc link too low", "0.625", "fault 12: the flux angle is lost"] {
            assert!(page.contains(part), "{part}");
        }
        // The results first, and of them those that failed.
        let place = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
        let rows = ["refused", "lost", "sound"].map(|name| place(&format!("href=\"#{name}\"")));
        assert!(place("<h2>Results</h2>") < rows[0] && rows.is_sorted(), "{rows:?}");
        assert!(rows[2] < place("<section"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
