//! `cargo sim board`: the flashed image on the virtual board, with a serial port.
//!
//! The virtual board is a separate program, because its emulator is GPL-2.0 and must not be linked here.
//! This module parses the options, builds image and program, and replaces this process with that program.

pub(crate) mod build;

pub use build::image;

use std::ffi::OsString;
use std::process::{Child, Command, Stdio};

use clap::{Args, ValueEnum};

use crate::prelude::*;

/// Options of a session with the virtual board.
#[derive(Args)]
pub struct Options {
    /// Motor, seed and duration.
    #[command(flatten)]
    pub input: Input,
    /// Board for which the image is built, with its power stage
    #[arg(long, value_name = "NAME", default_value = "reference")]
    pub board: String,
    /// Load on the shaft: `locked`, `free`, or `speed RPM`; the same as --set load.mode=...
    #[arg(long, value_names = ["LOAD", "RPM"], num_args = 1..=2, allow_negative_numbers = true)]
    pub load: Option<Vec<String>>,
    /// Plays a session as text (`> LINE` and its answer, `[2 s]`, `[until: TEXT]`) and checks the answers; ends after the
    /// file. Exit code 1 for a wrong answer, an unexpected `error:`, a text that does not come, or a fault at the end
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// Shows unexpected errors and faults during a script, but keeps the exit code 0
    #[arg(long, requires = "script")]
    pub lenient: bool,
    /// Keeps the contents of the flash in a file, so that `save` outlasts the session; creates the file if it is missing
    #[arg(long, value_name = "FILE")]
    pub flash: Option<PathBuf>,
    /// Least urgent lines of the log to show; `log LEVEL` at the console changes it
    #[arg(long, value_name = "LEVEL", default_value = "warn")]
    pub log: LogLevel,
    /// Runs as fast as possible instead of in real time
    #[arg(long)]
    pub fast: bool,
    /// Folder of the page
    #[arg(long, value_name = "DIR", default_value = OUT)]
    pub out: PathBuf,
    /// ELF file of the firmware [default: the image that `cargo firmware` builds]
    #[arg(long, value_name = "FILE")]
    pub elf: Option<PathBuf>,
    /// Shows the commands of the firmware build
    #[arg(long)]
    pub verbose: bool,
    /// For a program that starts the board: ends with its standard input, and prints the drive's flux angle, the
    /// motor's flux angle (turns) and the motor's flux (Wb) in lines `flux ...`
    #[arg(long, hide = true)]
    pub attached: bool,
}

/// Level of a log line, most urgent first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum LogLevel {
    /// No line has this level, so nothing is shown.
    Off,
    /// Faults.
    Error,
    /// Events that need attention.
    Warn,
    /// Changes of state.
    Info,
    /// Everything.
    Debug,
}

impl LogLevel {
    /// Returns the level of a name, in any case.
    pub fn named(name: &str) -> Option<Self> {
        Self::from_str(name, true).ok()
    }
}

impl Options {
    /// Returns the configuration of motor, inverter, measurement and load.
    ///
    /// # Errors
    /// As [`Input::config`]; [`Error::Refused`] if `--load` has none of its forms.
    pub fn config(&self) -> Result<Config, Error> {
        let mut config = self.input.config()?;
        let words: Vec<&str> = self.load.iter().flatten().map(String::as_str).collect();
        let refused = |why: &str| Err(Error::Refused(format!("--load {}: {why}", words[0])));
        match words[..] {
            [] => {}
            ["speed"] => return refused("write --load speed RPM"),
            ["speed", rpm] => {
                config.set("load.mode", "speed")?;
                config.set("load.speed_rpm", rpm)?;
            }
            [mode] => config.set("load.mode", mode)?,
            _ => return refused("only speed takes a number"),
        }
        Ok(config)
    }

    /// Returns the command line that repeats this session with this configuration.
    pub fn command(&self, config: &Config) -> String {
        let file = |option: &str, file: &Option<PathBuf>| {
            file.as_ref().map(|file| format!(" --{option} {}", file.display()))
        };
        let options = [
            (self.board != "reference").then(|| format!(" --board {}", self.board)),
            file("script", &self.script),
            self.lenient.then(|| " --lenient".to_owned()),
            file("flash", &self.flash),
            self.fast.then(|| " --fast".to_owned()),
        ];
        let mut command = self.input.command("board", config);
        command.extend(options.into_iter().flatten());
        command
    }
}

/// Builds the image, unless one is given, and replaces this process with the virtual board, which gets the arguments
/// after `board`. Returns only on failure.
///
/// # Errors
/// As [`Options::config`]; [`Error::Internal`] if a build fails or cargo does not run.
pub fn become_board(options: &Options) -> Result<(), Error> {
    let arguments = std::env::args_os().skip_while(|argument| argument != "board").skip(1);
    Err(replaced_by(built(options, arguments)?))
}

/// Builds what is needed; returns the command that runs the virtual board with these arguments and the image.
fn built(options: &Options, arguments: impl Iterator<Item = OsString>) -> Result<Command, Error> {
    // Wrong options are reported before the builds, which take minutes.
    options.config()?;
    let image =
        options.elf.is_none().then(|| build::image(&options.board, options.verbose)).transpose()?;
    let mut command = Command::new(build::virtual_board()?);
    command.args(arguments);
    if let Some(image) = image {
        command.arg("--elf").arg(image);
    }
    Ok(command)
}

/// Builds like [`become_board`] and starts the board as a child of this process; its standard input and output are pipes.
///
/// # Errors
/// As [`become_board`].
pub fn attach(options: &Options, arguments: &[String]) -> Result<Child, Error> {
    let attached = ["--attached".to_owned()];
    let mut command = built(options, arguments.iter().chain(&attached).map(OsString::from))?;
    let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
    child.map_err(|error| Error::Internal(format!("cannot run the virtual board: {error}")))
}

/// Replaces this process, so that a single process gets the terminal and its Ctrl-C. Returns only on failure.
#[cfg(unix)]
fn replaced_by(mut command: Command) -> Error {
    let error = std::os::unix::process::CommandExt::exec(&mut command);
    Error::Internal(format!("cannot run the virtual board: {error}"))
}

#[cfg(not(unix))]
fn replaced_by(_: Command) -> Error {
    Error::Refused("the virtual board needs pseudo-terminals, which only Unix has".into())
}
