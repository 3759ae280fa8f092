//! The command line.
#![deny(clippy::use_debug)]

mod lists;
mod report;
mod run;
mod used;

use std::io::Write as _;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

use crate::prelude::*;
use crate::{board, coefficients, config, console, experiments, first_light, passport};
pub use run::json;
use run::{Output, Request, Trace};

/// Simulates an induction-motor drive: the control code of the firmware, closed over a motor model.
///
/// Without a command: the sensorless torque steps of Figure 38.
#[derive(Parser)]
#[command(version, about, bin_name = "cargo sim")]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// List the most used experiments, and what each is for
    List {
        /// The other experiments: figures and tables of the two sources, and special questions
        #[arg(long)]
        lab: bool,
        /// Print a JSON list of all experiments, with the keys that each one uses
        #[arg(long, conflicts_with = "lab")]
        json: bool,
    },
    /// List every key of --set and of a configuration file, with value, unit and range
    Keys {
        /// Only keys that begin with this text: `motor`, `injection.`
        prefix: Option<String>,
        /// Print the configuration as TOML, for --config
        #[arg(long)]
        toml: bool,
        #[command(flatten)]
        input: Input,
    },
    /// List every motor of --motor; with a name: its numbers, their sources, and the lines for the console
    Motors {
        /// Name of the motor, or a file that ends in .toml or .json
        name: Option<String>,
        /// Print a motor file made from a nameplate, such as "750 W, 400 V, 1.86 A, 50 Hz, 1400 rpm"; circuit and dc link
        /// are estimated and marked
        #[arg(long, value_name = "TEXT", conflicts_with_all = ["name", "json"])]
        plate: Option<String>,
        /// Print a JSON list
        #[arg(long)]
        json: bool,
    },
    /// Run one experiment: print its tables, write its page and its plots as SVG files
    Run(Request),
    /// Run all experiments into one page
    ///
    /// The page and standard error name an experiment that is refused; the others still run.
    Report {
        /// Experiments of the page: all, after the printed values of both sources; or those values alone
        #[arg(long, value_enum, default_value = "all")]
        of: report::Of,
        #[command(flatten)]
        input: Input,
        /// Folder of the page
        #[arg(long, value_name = "DIR", default_value = OUT)]
        out: PathBuf,
    },
    /// Identify the motor from a recorded trace: a CSV file with voltages, currents and speed
    ///
    /// --motor, --config and --set describe the motor with which the result is compared.
    IdentifyTrace {
        #[command(flatten)]
        trace: Trace,
        #[command(flatten)]
        input: Input,
        #[command(flatten)]
        output: Output,
    },
    /// Print the shell completion for a command that runs this program
    Completion {
        /// The shell
        shell: clap_complete::Shell,
        /// Name of the command that is completed, such as an alias
        #[arg(long, value_name = "NAME", default_value = "hil-sim")]
        command: String,
    },
    /// Run the flashed image on an emulated controller, with a serial port to talk to it
    ///
    /// Builds the image, prints the path of a pseudo-terminal that is its console, and prints its log. `!help` lists
    /// the commands of the board itself: reset button, power, end. The page is written at the end, by Ctrl-C or when
    /// the time is over. Keys of the motor, inverter, measurement and load take effect. Keys of the drive do not,
    /// because the image has its own settings: use `set` at the console.
    Board(board::Options),
    /// Write the passport of a motor from the drive's measurements with the shaft locked: one JSON file and one page
    ///
    /// --motor FILE.json then loads a simulation model of the motor. Exit code 2 if the drive or the record does not give all values.
    Passport(passport::Options),
    /// Talk to a drive at a serial port: line editor, backup and restore of settings, plots of traces
    ///
    /// For a real board and for the pseudo-terminal of `cargo sim board`. `!help` lists the commands of this program;
    /// other lines go to the drive. Exit code 1 if the drive refuses a line of --command or of standard input.
    Console(console::Options),
    /// Write another image to a board over the serial port of its console, through ST's loader; settings are kept
    ///
    /// The drive must be off, its dc link below 20 V, and the supply of the gate drivers off. Builds the image, erases
    /// and writes its pages, reads them back, starts it and compares its check sum. Exit code 2 if file, port or drive
    /// are refused.
    Update(console::update::Options),
    /// Design the coefficients of a drive for the image `drive-and-log`, and write them beside it
    ///
    /// That image has no console and no design. Prints how to write image and coefficients through a debug probe.
    Coefficients(coefficients::Options),
    /// Power up a board for the first time, step by step: tells you what to do and measure, talks to the drive, judges,
    /// and stops on doubt
    ///
    /// Writes one test record, from which a later run continues. Exit code 1 if a step was not passed.
    FirstLight(first_light::Options),
}

/// Runs the command that the arguments of the process name. Exit codes: 0 done, 1 failed, 2 the request has to be
/// changed.
pub fn main() -> ExitCode {
    let cli = Cli::try_parse().unwrap_or_else(|error| {
        if !error.use_stderr() {
            error.exit()
        }
        eprintln!("{}", message(parser_text(&error)));
        std::process::exit(error.exit_code())
    });
    let result = match cli.command {
        None => {
            let input = Input { seed: 1, ..Input::default() };
            run::run(&Request { name: experiments::DEFAULT.into(), input, ..Request::default() })
        }
        Some(Command::List { lab, json }) => lists::experiments(json, lab).and_then(say),
        Some(Command::Motors { plate: Some(plate), .. }) => {
            config::motors::motor_file(&plate).and_then(say)
        }
        Some(Command::Motors { name, json, .. }) => {
            lists::motors(name.as_deref(), json).and_then(say)
        }
        Some(Command::Keys { prefix, toml, input }) => {
            lists::keys(prefix.as_deref(), toml, &input).and_then(say)
        }
        Some(Command::Run(request)) => run::run(&request),
        Some(Command::Report { of, input, out }) => report::report(of, &input, &out),
        Some(Command::IdentifyTrace { trace, input, output }) => {
            run::identify_trace(&trace, &input, &output)
        }
        Some(Command::Completion { shell, command }) => {
            let mut text = Vec::new();
            clap_complete::generate(shell, &mut Cli::command(), command, &mut text);
            say(String::from_utf8_lossy(&text))
        }
        Some(Command::Passport(options)) => passport::run(&options).and_then(say),
        Some(Command::Board(options)) => board::become_board(&options),
        Some(Command::Coefficients(options)) => coefficients::run(&options).and_then(say),
        Some(Command::Console(options)) => console::run(&options),
        Some(Command::Update(options)) => console::update::run(&options),
        Some(Command::FirstLight(options)) => first_light::run(&options),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", message(&error));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Prints on standard output, without control characters from texts of the user. A closed pipe, as with `head`, is no error.
fn say(text: impl AsRef<str>) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    match out.write_all(printable(text.as_ref()).as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::write(Path::new("standard output"))(e))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
