//! One experiment, or a group of them.

use std::sync::atomic::Ordering;
use std::time::Duration;

use serde_json::Value;
use trace::Voltages;

use super::{say, used};
use crate::config::motors::Motor;
use crate::experiments::source::evidence::Evidence;
use crate::experiments::{self, TRACE, identify_trace as trace, scenario};
use crate::first_light;
use crate::journal::{Header, Journal, Run as Kept};
use crate::outcome::{self, Origin};
use crate::passport;
use crate::prelude::*;
use crate::report::{self, Section};

/// Destination of the results of a run.
#[derive(Args, Default)]
pub struct Output {
    /// Folder of the page [default: out; with --json no page unless this is given]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON object and nothing else; for a group, one object with a list of all
    #[arg(long)]
    pub json: bool,
    /// Folder of CSV files, one per figure and one per table [default: none]
    #[arg(long, value_name = "DIR")]
    pub csv: Option<PathBuf>,
}

/// A requested run: its experiment, input and output.
#[derive(Args, Default)]
pub struct Request {
    /// Name of the experiment as in `list`, or the TOML file of a scenario
    pub name: String,
    /// For `profile`: CSV file with the profile; for `measured-start`: CSV file with the recorded start
    #[arg(long = "input", value_name = "FILE")]
    pub file: Option<PathBuf>,
    #[command(flatten)]
    pub input: Input,
    /// Keep every finished run of a statistical experiment in this file, and do not repeat the runs that are there
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
    #[command(flatten)]
    pub output: Output,
}

/// A recorded trace.
#[derive(Args)]
pub struct Trace {
    /// CSV file with a header; its columns are named in the documentation
    #[arg(long = "input", value_name = "FILE")]
    file: PathBuf,
    /// Another name of a column in the file; can be repeated
    #[arg(long = "column", value_name = "OURS=THEIRS")]
    columns: Vec<String>,
    /// Kind of the voltages: `commanded` by a drive that recorded them; measured at the terminals, `sampled` together
    /// with the currents, or `mean` from one row to the next
    #[arg(long, value_name = "KIND", value_parser = voltages, default_value = "commanded")]
    voltages: Voltages,
    /// Rows between the currents of a row and the action of its voltage [default: 0; commanded: 1 and the delay of the
    /// current filter, as the drive records it]
    #[arg(long, value_name = "ROWS", value_parser = |text: &str| within(text, -1.0, 10.0, "rows"), allow_negative_numbers = true)]
    delay: Option<f64>,
    /// Inverter voltage error at each phase current [default: 0; commanded: fitted]
    #[arg(long, value_name = "V", value_parser = |text: &str| within(text, 0.0, 100.0, "V"), allow_negative_numbers = true)]
    drop: Option<f64>,
    /// Time between two channels that were sampled one after another, in the order of their columns; 0: all at once
    /// [default: not known]
    #[arg(long, value_name = "US", value_parser = |text: &str| within(text, 0.0, 1000.0, "µs"), allow_negative_numbers = true)]
    skew: Option<f64>,
    /// Passport of the identified motor, with nameplate and dc link of --motor
    #[arg(long, value_name = "FILE.json", requires = "motor")]
    passport: Option<PathBuf>,
    /// Time of the first row
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    from: Option<f64>,
    /// Time of the last row
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    to: Option<f64>,
}

fn voltages(text: &str) -> Result<Voltages, String> {
    let known = Voltages::VALUES.iter().find(|kind| kind.word() == text);
    known.copied().ok_or_else(|| format!("allowed: {}", Voltages::WORDS.join(", ")))
}

/// Reads a number from `least` to `most`.
fn within(text: &str, least: f64, most: f64, unit: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number| (least..=most).contains(number));
    number.ok_or_else(|| format!("allowed: {least} to {most} {unit}"))
}

/// A run, in the form that the functions need that write its results.
pub struct Run<'a> {
    pub experiment: &'a Experiment,
    pub input: &'a Input,
    pub config: &'a Config,
    /// The command after `cargo sim`, without the configuration.
    pub command: String,
}

impl<'a> Run<'a> {
    pub fn section(&self, outcome: &'a Outcome) -> Section<'a> {
        let Experiment { name, stands_for, about, .. } = self.experiment;
        let command = self.input.command(&self.command, self.config);
        Section { name, stands_for, about, command, open: false, outcome }
    }

    /// Writes the files of an outcome and prints its results; returns the JSON object if requested.
    pub fn write(&self, outcome: &Outcome, output: &Output) -> Result<String, Error> {
        let name = self.experiment.name;
        let mut whole = outcome.clone();
        if !outcome.compared.is_empty() {
            let mut evidence = Evidence::default();
            evidence.add(name, outcome);
            whole.tables.insert(0, evidence.table(&outcome.compared));
        }
        let outcome = &whole;
        let origin = Origin::new(self.input.seed, &self.config.changes());
        let folder = output.out.clone().or_else(|| (!output.json).then(|| OUT.into()));
        let write = |folder: PathBuf| report::write(&folder, &origin, self.section(outcome));
        let path = folder.map(write).transpose()?;
        if let Some(folder) = &output.csv {
            for (file, text) in report::csv(outcome)? {
                report::write_whole(&folder.join(format!("{name}-{file}")), &text)?;
            }
        }
        if output.json {
            return outcome.to_json(name, &origin).map_err(|e| Error::Internal(e.to_string()));
        }
        let Experiment { about, stands_for, .. } = self.experiment;
        let head = report::paragraph(&format!("{name}: {about} ({stands_for})"), 0);
        let mut text = format!("{head}\n\n{}", report::text(outcome));
        if let (Some(path), false) = (path, self.input.quiet) {
            text.push_str(&format!("\nReport: {}\n", path.display()));
        }
        say(text).map(|()| String::new())
    }
}

/// Returns the error of an experiment whose run failed; its results are written before.
pub fn check_lost(name: &str, outcome: &Outcome) -> Result<(), Error> {
    match outcome.lost() {
        Some(reason) => Err(Error::Lost { name: name.to_owned(), reason }),
        None => Ok(()),
    }
}

/// Runs the experiment of this name, or all of a group, with the input file if the experiment takes one; prints the results.
///
/// # Errors
/// As [`made`]; [`Error::Lost`] after everything is written.
pub fn run(request: &Request) -> Result<(), Error> {
    let (objects, lost) = made(request)?;
    print(&objects, &request.output)?;
    lost
}

/// Returns the JSON object that `cargo sim run --json` prints; if the run failed, the object says so.
///
/// # Errors
/// The refusals and failures of `cargo sim run`.
pub fn json(name: String, file: Option<PathBuf>, input: Input) -> Result<String, Error> {
    let output = Output { json: true, ..Output::default() };
    let (objects, _) = made(&Request { name, file, input, output, ..Request::default() })?;
    Ok(outcome::joined(&objects))
}

/// Returns the JSON objects of the results, if requested, and whether one of the runs failed.
///
/// # Errors
/// As [`experiments::find`], [`Input::config`], [`used::check`] and [`resumed`]; the errors of the experiment; [`Error::Write`].
fn made(request: &Request) -> Result<(Vec<String>, Result<(), Error>), Error> {
    let Request { name, input, resume, output, .. } = request;
    let own = scenario::own(name);
    let chosen: Vec<_> = match &own {
        Some(own) => vec![own],
        None => {
            experiments::named(name).into_iter().map(experiments::find).collect::<Result<_, _>>()?
        }
    };
    if let (None, Some(one)) = (&own, chosen.first()) {
        experiments::check_file(one, request.file.as_deref())?;
    }
    let file = request.file.as_deref().or(own.as_ref().map(|_| Path::new(name)));
    let config = input.config()?;
    used::check(name, &chosen, input)?;
    let (mut objects, mut lost) = (Vec::new(), Ok(()));
    for experiment in chosen {
        let context = Context { file, ..Context::new(&config, input.seed, input.progress()) };
        let mut outcome = match resume {
            Some(path) => resumed(path, experiment, &context, input.quiet)?,
            None => experiment.run(&context)?,
        };
        let motor = input.motor.as_deref().map(Motor::find).transpose()?;
        outcome.remarks.extend(motor.and_then(|motor| motor.remark()));
        let command = match file {
            Some(_) if own.is_some() => format!("run {name}"),
            Some(file) => format!("run {} --input {}", experiment.name, file.display()),
            None => format!("run {}", experiment.name),
        };
        let run = Run { experiment, input, config: &config, command };
        objects.push(run.write(&outcome, output)?);
        lost = lost.and(check_lost(experiment.name, &outcome));
    }
    Ok((objects, lost))
}

/// Runs a statistical experiment whose finished runs are in a file.
///
/// # Errors
/// As [`experiments::statistical`], [`Journal::open`] and [`Statistical::resumed`](experiments::statistics::Statistical::resumed).
fn resumed(
    path: &Path,
    experiment: &Experiment,
    context: &Context<'_>,
    quiet: bool,
) -> Result<Outcome, Error> {
    let statistical = experiments::statistical(experiment)?;
    let all = (statistical.runs)(context)?;
    let header = Header::new(experiment.name, context.config, context.seed, all)?;
    let journal = Journal::open(path, &header)?;
    say_on_interrupt(path, all)?;
    let path = message(path.display());
    // A torn line is reported even in quiet mode.
    if let Some(line) = journal.torn {
        eprintln!("note: {path}, line {line}, was torn; its run is done again");
    }
    let done = journal.runs.len();
    if done > 0 && !quiet {
        eprintln!("note: {done} of {all} runs are stored already");
    }
    let keep = |run, record: Value| journal.append(&Kept { run, record });
    let outcome = (statistical.resumed)(context, &journal.runs, &keep)?;
    Ok(experiment.remarked(outcome, context.config))
}

/// Makes Ctrl-C say how many runs are kept in the file, and end the process.
///
/// # Errors
/// As [`first_light::interruptible`].
fn say_on_interrupt(path: &Path, all: usize) -> Result<(), Error> {
    let (stop, path) = (first_light::interruptible()?, path.to_owned());
    std::thread::spawn(move || {
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(50));
        }
        let stored = std::fs::read_to_string(&path).unwrap_or_default();
        let kept = stored.matches('\n').count().saturating_sub(1);
        let path = message(path.display());
        eprintln!("\ninterrupted: {path} keeps {kept} of {all} runs; the same command continues");
        std::process::exit(130)
    });
    Ok(())
}

/// Identifies the motor from a trace.
///
/// # Errors
/// As [`trace::identify`], [`Input::config`]; [`Error::Write`].
pub fn identify_trace(given: &Trace, input: &Input, output: &Output) -> Result<(), Error> {
    let config = input.config()?;
    let Trace { voltages, delay, drop: drop_v, skew, from, to, .. } = *given;
    let (columns, times, skew_s) = (given.columns.clone(), [from, to], skew.map(|us| 1e-6 * us));
    let reading = trace::Reading { columns, voltages, delay, drop_v, times, skew_s };
    let outcome = trace::identify(&given.file, &reading, &config)?;
    if let Some(path) = &given.passport {
        passport::write(&passport::of_trace(&outcome, &config, &given.file), path)?;
    }
    used::check(TRACE.name, &[&TRACE], input)?;
    let mut command = format!("identify-trace --input {}", given.file.display());
    if voltages != Voltages::Commanded {
        command.push_str(&format!(" --voltages {}", voltages.word()));
    }
    let options = [("delay", delay), ("drop", drop_v), ("skew", skew), ("from", from), ("to", to)];
    for (name, value) in options {
        command.extend(value.map(|value| format!(" --{name} {value}")));
    }
    for column in &given.columns {
        command.push_str(&format!(" --column {column}"));
    }
    let run = Run { experiment: &TRACE, input, config: &config, command };
    print(&[run.write(&outcome, output)?], output)
}

/// Prints the JSON objects, if requested.
///
/// # Errors
/// [`Error::Write`].
pub fn print(objects: &[String], output: &Output) -> Result<(), Error> {
    if output.json { say(format!("{}\n", outcome::joined(objects))) } else { Ok(()) }
}
