//! The command line.
#![deny(clippy::use_debug)]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::board;
use crate::config::motors::Motor;
use crate::config::{Config, Key};
use crate::error::Error;
use crate::experiments::{self, Context, EXPERIMENTS, Experiment};
use crate::input::{Input, OUT};
use crate::outcome::{self, Cell, Origin, Outcome, Table};
use crate::progress::Progress;
use crate::report::{self, Section};

/// Simulates an induction-motor drive: the control code of the firmware, closed over a motor model.
///
/// Without a command: the sensorless torque steps of Figure 38.
#[derive(Parser)]
#[command(version, about)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Every experiment, with the figure or table it stands for
    List,
    /// Every key that --set and a configuration file take, with unit, default and range
    Keys,
    /// Every motor that --motor takes; with a name: its numbers, their sources, and the lines for the console
    Motors {
        /// Name of the motor, or a file that ends in .toml
        name: Option<String>,
    },
    /// Run one experiment: print its tables, write its page and its plots as SVG files
    Run {
        /// Name of the experiment, as `list` shows it
        name: String,
        #[command(flatten)]
        input: Input,
        /// Folder of the page [default: out; with --json no page unless this is given]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Print one JSON object and nothing else; of a group, one with all in a list
        #[arg(long)]
        json: bool,
        /// Folder of CSV files, one a figure and one a table [default: none]
        #[arg(long, value_name = "DIR")]
        csv: Option<PathBuf>,
    },
    /// Run all experiments into one page
    Report {
        #[command(flatten)]
        input: Input,
        /// Folder of the page
        #[arg(long, value_name = "DIR", default_value = OUT)]
        out: PathBuf,
    },
    /// Run the image that is flashed on an emulated controller, with a serial port to talk to it
    ///
    /// Builds the image, prints the path of a pseudo-terminal that is its console, and its log. `quit`,
    /// Ctrl-C or the end of the time write the page. Keys of the motor, inverter, measurement and load
    /// count; those of the drive do not, for the image has settings of its own: `set` at the console.
    Board(board::Options),
}

/// Runs the command that the arguments of the process name. Exit codes: 0 done, 1 failed, 2 the request
/// has to be changed.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        None => {
            run(experiments::DEFAULT, &Input { seed: 1, ..Input::default() }, &Output::default())
        }
        Some(Command::List) => say(&list()),
        Some(Command::Motors { name: None }) => say(&report::table(&motors())),
        Some(Command::Motors { name: Some(name) }) => {
            Motor::find(&name).and_then(|motor| say(&motor_text(&motor)?))
        }
        Some(Command::Keys) => say(&report::table(&keys())),
        Some(Command::Run { name, input, out, json, csv }) => {
            run(&name, &input, &Output { out, json, csv })
        }
        Some(Command::Report { input, out }) => full_report(&input, &out),
        Some(Command::Board(options)) => board::become_board(&options),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn list() -> String {
    let mut text = String::new();
    for Experiment { name, stands_for, about, .. } in EXPERIMENTS {
        text.push_str(&format!("{name:<20} {stands_for}\n{}\n\n", report::paragraph(about, 4)));
    }
    text
}

fn motors() -> Table {
    let mut table = Table::new("", &["motor", "rated data", "numbers"]);
    for motor in Motor::all() {
        let recalled = motor.source.iter().filter(|source| source.unverified);
        let keys: Vec<_> = recalled.flat_map(|source| source.keys.clone()).collect();
        let numbers = match keys[..] {
            [] => "all with a source".to_owned(),
            _ => format!("unverified: {}", keys.join(", ")),
        };
        table.row([motor.name, motor.title, numbers].map(Cell::from));
    }
    table
}

fn motor_text(motor: &Motor) -> Result<String, Error> {
    let mut config = Config::default();
    motor.apply(&mut config)?;
    let mut table = Table::new("", &["key", "value", "unit", "source"]);
    for (key, value) in motor.settings() {
        let unit = Key::named(&key)?.first().map_or("", |key| key.unit()).to_owned();
        let source = motor.source_of(&key).map_or(String::new(), |source| {
            format!("{}{}", if source.unverified { "UNVERIFIED: " } else { "" }, source.from)
        });
        table.row([key, value.to_string(), unit, source].map(Cell::from));
    }
    let m = config.drive.motor;
    Ok(format!(
        "{}: {}\n\n{}\n\n{}\nLeakage inductance {:.4} mH, rotor time constant {:.0} ms, carrier {:.1} V.\n\n\
         At the console, with the scales of your board:\n{}\n",
        motor.name,
        motor.title,
        motor.about.trim(),
        report::table(&table),
        1e3 * m.sigma_l_s(),
        1e3 * m.tau_r(),
        config.drive.carrier_v(),
        motor.console_lines().join("\n"),
    ))
}

fn keys() -> Table {
    let default = Config::default();
    let mut table = Table::new("", &["key", "unit", "default", "allowed", "meaning"]);
    for key in Key::all() {
        let default = key.get(&default).to_string();
        let range = key.allowed().describe("");
        let cells =
            [key.assigned_name(), key.unit().to_owned(), default, range, key.help().to_owned()];
        table.row(cells.map(Cell::from));
    }
    table
}

fn context(config: &Config, seed: u64) -> Context<'_> {
    Context { config, seed, seconds: config.extent.seconds, progress: Progress::default() }
}

fn section<'a>(
    experiment: &'a Experiment,
    input: &Input,
    config: &Config,
    outcome: &'a Outcome,
) -> Section<'a> {
    let Experiment { name, stands_for, about, .. } = experiment;
    Section {
        name,
        stands_for,
        about,
        command: input.command(&format!("run {name}"), config),
        outcome,
    }
}

/// Where the results of a run go.
#[derive(Default)]
struct Output {
    out: Option<PathBuf>,
    json: bool,
    csv: Option<PathBuf>,
}

/// Runs the experiment of this name, or all of a group.
fn run(name: &str, input: &Input, output: &Output) -> Result<(), Error> {
    let names = experiments::named(name);
    let objects: Vec<_> =
        names.iter().map(|name| run_one(name, input, output)).collect::<Result<_, _>>()?;
    match objects.as_slice() {
        _ if !output.json => Ok(()),
        [object] => say(&format!("{object}\n")),
        objects => say(&format!("{}\n", outcome::group(objects))),
    }
}

/// Runs an experiment, writes its files and prints its results; returns the JSON object if that is wanted.
fn run_one(name: &str, input: &Input, output: &Output) -> Result<String, Error> {
    let experiment = experiments::find(name)?;
    let config = input.config()?;
    let outcome = (experiment.run)(&context(&config, input.seed))?;
    let origin = Origin::new(input.seed, &config.changes());
    let folder = output.out.clone().or_else(|| (!output.json).then(|| OUT.into()));
    let path = folder.as_ref().map(|folder| folder.join(format!("{name}.html")));
    if let (Some(folder), Some(path)) = (&folder, &path) {
        let section = section(experiment, input, &config, &outcome);
        report::write_whole(path, &report::page("Induction drive", &origin, &[section])?)?;
        for figure in &outcome.figures {
            let file = folder.join(format!("{name}-{}.svg", figure.name));
            report::write_whole(&file, &report::svg(figure)?)?;
        }
    }
    if let Some(folder) = &output.csv {
        for (file, text) in report::csv(&outcome)? {
            report::write_whole(&folder.join(format!("{name}-{file}")), &text)?;
        }
    }
    if output.json {
        return outcome.to_json(name, &origin).map_err(|e| Error::Internal(e.to_string()));
    }
    let Experiment { about, stands_for, .. } = experiment;
    let mut text = format!("{name}: {about} ({stands_for})\n\n{}", report::text(&outcome));
    if let Some(path) = path {
        text.push_str(&format!("\nReport: {}\n", path.display()));
    }
    say(&text).map(|()| String::new())
}

fn full_report(input: &Input, out: &Path) -> Result<(), Error> {
    let config = input.config()?;
    let context = context(&config, input.seed);
    let outcomes =
        context.in_parallel("report", EXPERIMENTS, |_, experiment| (experiment.run)(&context))?;
    let sections: Vec<_> = EXPERIMENTS
        .iter()
        .zip(&outcomes)
        .map(|(experiment, outcome)| section(experiment, input, &config, outcome))
        .collect();
    let origin = Origin::new(input.seed, &config.changes());
    let path = out.join("report.html");
    report::write_whole(
        &path,
        &report::page("Induction drive: all experiments", &origin, &sections)?,
    )?;
    say(&format!("Report: {}\n", path.display()))
}

/// Prints on standard output. A closed pipe, as behind `head`, is no error.
fn say(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write(Path::new("standard output"))(e))
        }
        _ => Ok(()),
    }
}
