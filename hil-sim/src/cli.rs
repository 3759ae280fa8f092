//! The command line.
#![deny(clippy::use_debug)]

mod lists;
mod merge;
mod part;
mod report;
mod run;
mod used;

use std::io::Write as _;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

use crate::board;
use crate::console;
use crate::experiments;
use crate::first_light;
use crate::passport;
use crate::prelude::*;
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
    /// The experiments of every day, with the figure or table each stands for
    List {
        /// The other experiments: figures and tables of the two sources, and special questions
        #[arg(long)]
        lab: bool,
        /// Print a JSON list of all, with the keys that each experiment uses
        #[arg(long, conflicts_with = "lab")]
        json: bool,
    },
    /// Every key that --set and a configuration file take, with value, unit and range
    Keys {
        /// Only keys that begin so: `motor`, `injection.`
        prefix: Option<String>,
        /// Print the configuration as TOML, which --config reads
        #[arg(long)]
        toml: bool,
        #[command(flatten)]
        input: Input,
    },
    /// Every motor that --motor takes; with a name: its numbers, their sources, and the lines for the console
    Motors {
        /// Name of the motor, or a file that ends in .toml or .json
        name: Option<String>,
        /// Print a JSON list
        #[arg(long)]
        json: bool,
    },
    /// Run one experiment: print its tables, write its page and its plots as SVG files
    Run(Request),
    /// Merge the shards of a run: prints the JSON object of the whole run
    ///
    /// The shards are what `run NAME --shard I/N` printed, in any order. Exit code 2 when one is missing, there twice, torn,
    /// or of another run.
    Merge {
        /// The files
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Folder of the page [default: no page]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Folder of CSV files, one a figure and one a table [default: none]
        #[arg(long, value_name = "DIR")]
        csv: Option<PathBuf>,
    },
    /// Run all experiments into one page
    ///
    /// An experiment that is refused is named there and on standard error; the others run.
    Report {
        /// Which experiments: all, after the printed values of both sources; or those values alone
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
    /// --motor, --config and --set describe the motor that the result is compared with.
    IdentifyTrace {
        #[command(flatten)]
        trace: Trace,
        #[command(flatten)]
        input: Input,
        #[command(flatten)]
        output: Output,
    },
    /// Print the completion of a shell, for a command that runs this program
    Completion {
        /// The shell
        shell: clap_complete::Shell,
        /// Name of the command that is completed, such as an alias
        #[arg(long, value_name = "NAME", default_value = "hil-sim")]
        command: String,
    },
    /// Run the image that is flashed on an emulated controller, with a serial port to talk to it
    ///
    /// Builds the image, prints the path of a pseudo-terminal that is its console, and its log. `!help` lists the
    /// commands of the board itself: reset button, power, end. The end, Ctrl-C or the end of the time write the page. Keys of the motor, inverter, measurement and load
    /// count; those of the drive do not, for the image has settings of its own: `set` at the console.
    Board(board::Options),
    /// The passport of a motor, from what the drive measures and learns of it with the shaft locked: one JSON file and one page
    ///
    /// --motor FILE.json then loads a twin of the motor. Exit code 2 when the drive or the record does not give it whole.
    Passport(passport::Options),
    /// Talk to a drive at a serial port: line editor, backup and restore of settings, plots of traces
    ///
    /// For a board and for the pseudo-terminal of `cargo sim board` alike. `!help` lists the commands of this program;
    /// other lines go to the drive. Exit code 1 when the drive refuses a line of --command or of standard input.
    Console(console::Options),
    /// Write another image to a board over the serial port of its console, through ST's loader; settings are kept
    ///
    /// The drive must be off, its dc link below 20 V, and the supply of the gate drivers off. Builds the image, erases and
    /// writes its pages, reads them back, starts it and compares its check sum. Exit code 2 when file, port or drive refuse.
    Update(console::update::Options),
    /// First power-up of a board, step by step: says what to do and measure, talks to the drive, judges, and stops on doubt
    ///
    /// Ends in one file of evidence, with which a later run goes on. Exit code 1 for a step that was not passed.
    FirstLight(first_light::Options),
}

/// Runs the command that the arguments of the process name. Exit codes: 0 done, 1 failed or lost, 2 the request
/// has to be changed.
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
        Some(Command::Motors { name, json }) => lists::motors(name.as_deref(), json).and_then(say),
        Some(Command::Keys { prefix, toml, input }) => {
            lists::keys(prefix.as_deref(), toml, &input).and_then(say)
        }
        Some(Command::Run(request)) => run::run(&request),
        Some(Command::Merge { files, out, csv }) => merge::merge(&files, out, csv),
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

/// Prints on standard output, without the control characters that a text of the user may have. A closed pipe, as behind `head`, is no error.
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
