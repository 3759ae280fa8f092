//! Commands: where they run, how they are shown, and how long they take.

use std::env;
use std::ffi::{OsStr, OsString};
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};

/// The microcontroller: Cortex-M4 with a single-precision floating-point unit.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// Profile of the image that is flashed.
pub const PROFILE: &str = "firmware";

/// The root of the workspace.
pub fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

/// The directory of build results.
pub fn target_dir() -> Result<PathBuf> {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(dir) => std::path::absolute(dir).context("CARGO_TARGET_DIR"),
        None => Ok(root().join("target")),
    }
}

/// The cargo that started this program, with arguments that have no spaces inside.
pub fn cargo(arguments: &str) -> Command {
    let mut command = command(env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")));
    command.args(arguments.split(' '));
    command
}

/// A command that runs in the root of the workspace.
pub fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// Names of the steps so far, and how long each took.
static TIMES: Mutex<Vec<(String, Duration)>> = Mutex::new(Vec::new());

/// Prints and runs one step of a task.
pub fn step(name: &str, command: &mut Command) -> Result<()> {
    println!("\n==> {name}: {}", shown(command));
    timed(name, || {
        let status = command.status().with_context(|| format!("cannot run: {command:?}"))?;
        ensure!(status.success(), "{name}, {status}\n    {command:?}");
        Ok(())
    })
}

/// Runs one step of a task and notes its time.
pub fn timed(name: &str, step: impl FnOnce() -> Result<()>) -> Result<()> {
    let began = Instant::now();
    step()?;
    println!("    {name}: done in {:.0} s", began.elapsed().as_secs_f64());
    TIMES.lock().unwrap_or_else(PoisonError::into_inner).push((name.to_owned(), began.elapsed()));
    Ok(())
}

/// Names of the steps so far, and how long each took.
pub fn times() -> Vec<(String, Duration)> {
    TIMES.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// The program and its arguments, without paths and variables.
fn shown(command: &Command) -> String {
    let program = Path::new(command.get_program()).file_name().unwrap_or_default();
    let words: Vec<_> = [program].into_iter().chain(command.get_args()).collect();
    words.join(OsStr::new(" ")).to_string_lossy().into_owned()
}

/// Prints how much of a limit is used; fails above it.
pub fn limit<T: Display + PartialOrd>(what: &str, used: T, limit: T, unit: &str) -> Result<()> {
    println!("{what}: {used} of {limit} {unit}");
    ensure!(used <= limit, "{what}: {used} {unit}, {limit} are allowed");
    Ok(())
}

/// Whether a command runs and succeeds; its output is not shown.
pub fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}

/// The output of a command, if it runs and succeeds.
pub fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = command(program).args(arguments).stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Fails if probe-rs is not there.
pub fn probe_rs() -> Result<()> {
    let probe = command("probe-rs").arg("--version").output();
    if probe.is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound) {
        bail!("probe-rs is missing. Type:\n    cargo install probe-rs-tools --locked");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_shown_without_paths_and_variables() {
        let mut command = Command::new("/some/toolchain/bin/cargo");
        command.args(["doc", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings");
        assert_eq!(shown(&command), "cargo doc --no-deps");
    }

    #[test]
    fn a_failing_step_names_the_whole_command() {
        let error = step("nothing", Command::new("false").env("A", "b")).unwrap_err();
        assert!(error.to_string().ends_with("\n    A=\"b\" \"false\""), "{error}");
    }
}
