//! Builds of the image and of the virtual board. A build shows progress at least every ten seconds: cargo's progress if
//! standard error is a terminal, otherwise lines of our own.

use std::io::{BufRead as _, BufReader, IsTerminal as _};
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};

use crate::prelude::*;
use crate::repository;

/// Time between two lines of [`while_saying`].
const INTERVAL: Duration = Duration::from_secs(10);

/// Builds and checks the image of a board as it is flashed; returns its path.
///
/// # Errors
/// [`Error::Internal`] if cargo does not run or the build fails.
pub fn image(board: &str, verbose: bool) -> Result<PathBuf, Error> {
    eprintln!("firmware: rebuilt where its source has changed; a few minutes the first time");
    let mut command = cargo();
    command.args(["run", "--package", "xtask", "--", "firmware", "--board", board]);
    command.current_dir(root()?);
    // The last line is the path; the other lines report progress of xtask.
    let mut lines = lines_of("firmware", command)?;
    let path = lines.pop().map(PathBuf::from);
    if verbose {
        lines.iter().for_each(|line| eprintln!("{line}"));
    }
    path.ok_or_else(|| failed("firmware", "no image"))
}

/// Builds the virtual board; returns the path of its program.
///
/// # Errors
/// As [`image`].
pub fn virtual_board() -> Result<PathBuf, Error> {
    eprintln!("emulator: rebuilt where its source has changed; about 2 minutes the first time");
    let mut command = cargo();
    command.args(["build", "--release", "--bin", "board"]);
    command.arg("--message-format=json-render-diagnostics");
    command.current_dir(root()?.join("hil-sim/virtual-board"));
    let lines = lines_of("emulator", command)?;
    let program = lines.iter().rev().find_map(|line| executable(line));
    program.ok_or_else(|| failed("emulator", "cargo names no program"))
}

/// Returns the program that a message of cargo names.
fn executable(message: &str) -> Option<PathBuf> {
    let message: serde_json::Value = serde_json::from_str(message).ok()?;
    message["executable"].as_str().map(PathBuf::from)
}

/// Runs a command to its end; returns the lines of its standard output.
fn lines_of(name: &str, mut command: Command) -> Result<Vec<String>, Error> {
    let mut run = || {
        let mut child = command.stdout(Stdio::piped()).spawn()?;
        let lines = child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines());
        let lines: Result<Vec<_>, _> = lines.collect();
        child.wait().and_then(|status| Ok((status, lines?)))
    };
    let say = |passed: Duration| eprintln!("{name}: building for {} s", passed.as_secs());
    let is_terminal = std::io::stderr().is_terminal();
    let done = if is_terminal { run() } else { while_saying(INTERVAL, say, run) };
    match done {
        Ok((status, lines)) if status.success() => Ok(lines),
        Ok((status, _)) => Err(failed(name, status)),
        Err(error) => Err(failed(name, format!("cannot run cargo: {error}"))),
    }
}

fn failed(name: &str, why: impl std::fmt::Display) -> Error {
    Error::Internal(format!("build of the {name}: {why}"))
}

/// Does some work, and prints after every interval how long it has taken so far.
fn while_saying<T>(
    interval: Duration,
    say: impl Fn(Duration) + Send,
    work: impl FnOnce() -> T,
) -> T {
    let began = Instant::now();
    let (done, until_done) = channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while until_done.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
                say(began.elapsed());
            }
        });
        let result = work();
        drop(done);
        result
    })
}

fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

fn root() -> Result<PathBuf, Error> {
    let refused = "the virtual board is built in the repository: change to it";
    repository::root().ok_or_else(|| Error::Refused(refused.into()))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;

    #[test]
    fn long_work_is_accompanied_and_short_work_is_not() {
        let said = AtomicU32::new(0);
        let work_for = |ms| {
            said.store(0, Ordering::Relaxed);
            let say = |_| {
                said.fetch_add(1, Ordering::Relaxed);
            };
            while_saying(Duration::from_millis(200), say, || {
                std::thread::sleep(Duration::from_millis(ms));
            });
            said.load(Ordering::Relaxed)
        };
        assert_eq!(work_for(0), 0);
        assert!((2..=7).contains(&work_for(1500)));
    }
}
