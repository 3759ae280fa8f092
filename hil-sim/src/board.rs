//! `cargo sim board`: the flashed image on the virtual board, with a serial port.
//!
//! The virtual board is a separate program, because its emulator is GPL-2.0 and must not be linked here.
//! This module parses the options, builds the image and replaces this process by that program.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;

use crate::config::{Config, Value};
use crate::error::Error;
use crate::input::{Input, OUT};

/// Options of a session with the virtual board.
#[derive(Args)]
pub struct Options {
    /// Motor, seed and duration.
    #[command(flatten)]
    pub input: Input,
    /// Load on the shaft: `locked`, `free`, or `speed RPM`; the same as --set load.mode=...
    #[arg(long, value_names = ["LOAD", "RPM"], num_args = 1..=2, allow_negative_numbers = true)]
    pub load: Option<Vec<String>>,
    /// Types the lines of a file: `at SECONDS: LINE`, `wait SECONDS: LINE`, `wait for TEXT`; ends after it
    #[arg(long, value_name = "FILE")]
    pub script: Option<PathBuf>,
    /// As fast as possible instead of in real time
    #[arg(long)]
    pub fast: bool,
    /// Folder of the page
    #[arg(long, value_name = "DIR", default_value = OUT)]
    pub out: PathBuf,
    /// The firmware's ELF [default: the image that `cargo firmware` builds]
    #[arg(long, value_name = "FILE")]
    pub elf: Option<PathBuf>,
}

impl Options {
    /// The configuration of motor, inverter, measurement and load.
    ///
    /// # Errors
    /// As [`Input::config`]; [`Error::Refused`] when `--load` is not one of its forms.
    pub fn config(&self) -> Result<Config, Error> {
        let mut config = self.input.config()?;
        let words: Vec<&str> = self.load.iter().flatten().map(String::as_str).collect();
        match words[..] {
            [] => {}
            ["speed"] => {
                return Err(Error::Refused("--load speed: write --load speed RPM".into()));
            }
            ["speed", rpm] => {
                config.set("load.mode", &Value::from_text("speed"))?;
                config.set("load.speed_rpm", &Value::from_text(rpm))?;
            }
            [mode] => config.set("load.mode", &Value::from_text(mode))?,
            [mode, ..] => {
                return Err(Error::Refused(format!("--load {mode}: only speed takes a number")));
            }
        }
        Ok(config)
    }

    /// The command line that repeats this session with this configuration.
    pub fn command(&self, config: &Config) -> String {
        let mut command = self.input.command("board", config);
        if let Some(script) = &self.script {
            command.push_str(&format!(" --script {}", script.display()));
        }
        if self.fast {
            command.push_str(" --fast");
        }
        command
    }
}

/// Builds the image, unless one is named, and replaces this process by the virtual board, which gets the
/// arguments behind `board`. Returns on failure only.
///
/// # Errors
/// As [`Options::config`]; [`Error::Internal`] when the image cannot be built or cargo does not run.
pub fn become_board(options: &Options) -> Result<(), Error> {
    // Wrong options are reported before the build, which takes a minute.
    options.config()?;
    let mut command = cargo();
    command.args(["run", "--quiet", "--release", "--package", "virtual-board", "--bin", "board"]);
    command.arg("--manifest-path").arg(root().join("Cargo.toml")).arg("--");
    command.args(std::env::args_os().skip_while(|argument| argument != "board").skip(1));
    if options.elf.is_none() {
        command.arg("--elf").arg(built_image()?);
    }
    Err(replaced_by(command))
}

/// Replaces this process, so that one process gets the terminal and its Ctrl-C. Returns on failure only.
#[cfg(unix)]
fn replaced_by(mut command: Command) -> Error {
    let error = std::os::unix::process::CommandExt::exec(&mut command);
    Error::Internal(format!("cannot run cargo: {error}"))
}

#[cfg(not(unix))]
fn replaced_by(_: Command) -> Error {
    Error::Refused("the virtual board needs pseudo-terminals, which only Unix has".into())
}

/// Builds and checks the image as it is flashed; returns its path.
fn built_image() -> Result<PathBuf, Error> {
    let failed = |why: String| Error::Internal(format!("cargo xtask firmware: {why}"));
    let mut child = cargo()
        .args(["xtask", "firmware"])
        .current_dir(root())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|e| failed(e.to_string()))?;
    let mut last = None;
    for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()) {
        let line = line.map_err(|e| failed(e.to_string()))?;
        // The last line is the path; the others are for people.
        if let Some(before) = last.replace(line) {
            eprintln!("{before}");
        }
    }
    let status = child.wait().map_err(|e| failed(e.to_string()))?;
    match last {
        Some(path) if status.success() => Ok(path.into()),
        _ => Err(failed(status.to_string())),
    }
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}
