//! All experiments on one page.

use super::run::Run;
use super::{say, used};
use crate::experiments::source::evidence::Evidence;
use crate::experiments::{self, EXPERIMENTS};
use crate::outcome::Origin;
use crate::prelude::*;
use crate::report::{self, Section};

/// Subject of a page.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Of {
    /// Both sources, then all experiments
    All,
    /// The printed values of both sources beside ours
    Sources,
}

/// Runs all experiments, or those that repeat the sources, into one page. An experiment that is refused or fails is
/// named in the page and on standard error.
///
/// # Errors
/// As [`Input::config`] and [`used::check`]; [`Error::Write`]; [`Error::Incomplete`] after the page has been written.
pub fn report(of: Of, input: &Input, out: &Path) -> Result<(), Error> {
    let is_source = |one: &Experiment| experiments::SOURCES.iter().any(|name| name == one.name);
    let is_chosen = |one: &&Experiment| of == Of::All || is_source(one);
    report_of(&EXPERIMENTS.iter().filter(is_chosen).collect::<Vec<_>>(), of, input, out)
}

fn report_of(experiments: &[&Experiment], of: Of, input: &Input, out: &Path) -> Result<(), Error> {
    let config = input.config()?;
    used::check("report", experiments, input)?;
    let context = Context::new(&config, input.seed, input.progress());
    let bar = context.progress.bar("report", experiments.len() as u64);
    let run = |experiment: &&Experiment| {
        let outcome = experiment.run(&context).unwrap_or_else(|error| Outcome::refused(&error));
        bar.inc(1);
        outcome
    };
    let outcomes: Vec<Outcome> = experiments.par_iter().map(run).collect();
    drop(bar);

    let mut evidence = Evidence::default();
    for (experiment, outcome) in experiments.iter().zip(&outcomes) {
        evidence.add(experiment.name, outcome);
    }
    let chapters = evidence.chapters();
    let command = |run: &String| input.command(&format!("run {run}"), &config);
    let mut sections: Vec<_> = chapters
        .iter()
        .map(|chapter| Section {
            name: &chapter.name,
            stands_for: chapter.source,
            about: &chapter.about,
            open: chapter.runs.is_empty() || !chapter.outcome.figures.is_empty(),
            command: chapter.runs.iter().map(command).collect::<Vec<_>>().join("\n"),
            outcome: &chapter.outcome,
        })
        .collect();
    if of == Of::All {
        for (experiment, outcome) in experiments.iter().zip(&outcomes) {
            let command = format!("run {}", experiment.name);
            sections.push(Run { experiment, input, config: &config, command }.section(outcome));
        }
    }
    let origin = Origin::new(input.seed, &config.changes());
    let (file, title) = match of {
        Of::All => ("report.html", "Induction drive: sources and experiments"),
        Of::Sources => ("sources.html", "Induction drive: both sources as printed, beside ours"),
    };
    let path = out.join(file);
    let page = report::page(title, &origin, &sections)?;
    report::write_whole(&path, &page)?;
    say(format!("Report: {}\n", path.display()))?;

    let mut names = Vec::new();
    for (experiment, outcome) in experiments.iter().zip(&outcomes) {
        if let Some(reason) = outcome.lost() {
            eprintln!("{}: {reason}", experiment.name);
            names.push(experiment.name.to_owned());
        }
    }
    let all = experiments.len();
    if names.is_empty() { Ok(()) } else { Err(Error::Incomplete { all, names }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_goes_on_when_experiments_are_refused_or_lost() {
        let experiments = [
            Experiment::new("refused", |_| Err(Error::Refused("dc link too low".into()))),
            Experiment::new("sound", |_| {
                let mut outcome = Outcome::default();
                outcome.metrics.set("torque_nm", 0.625);
                Ok(outcome)
            }),
            Experiment::new("lost", |_| {
                let faults = vec!["fault 12: the flux angle is lost".to_owned()];
                Ok(Outcome { faults, ..Outcome::default() })
            }),
        ];
        let folder = std::env::temp_dir().join(format!("hil-sim-report-{}", std::process::id()));
        let experiments: Vec<_> = experiments.iter().collect();
        let error = report_of(&experiments, Of::All, &Input::default(), &folder).unwrap_err();
        assert_eq!(error.to_string(), "2 of 3 experiments failed: refused, lost");
        assert_eq!(error.exit_code(), 1);
        let page = std::fs::read_to_string(folder.join("report.html")).unwrap();
        for part in ["Refused: dc link too low", "0.625", "fault 12: the flux angle is lost"] {
            assert!(page.contains(part), "{part}");
        }
        // The results come first, and among them the failed ones.
        let place = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
        let rows = ["refused", "lost", "sound"].map(|name| place(&format!("href=\"#{name}\"")));
        assert!(place("<h2>Results</h2>") < rows[0] && rows.is_sorted(), "{rows:?}");
        assert!(rows[2] < place("<section"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
