//! Commands: their folder, their output, and their run time.

use std::ffi::{OsStr, OsString};
use std::fmt::Display;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use std::{env, fs};

use anyhow::{Context, Result, bail, ensure};

/// The microcontroller: Cortex-M4 with a single-precision floating-point unit.
pub const TARGET: &str = "thumbv7em-none-eabihf";
/// WebAssembly.
pub const BROWSER: &str = "wasm32-unknown-unknown";
/// Profile of the image that is flashed.
pub const PROFILE: &str = "firmware";

/// Packages of `cargo test`, live page and tasks. A smaller selection would need other features of the crates below, and build them
/// again.
pub const TESTED: &str =
    "--workspace --exclude induction-drive-benches --exclude induction-drive-python";

/// Profile of the programs and the wheel of a release.
pub const SHIPPED: &str = "shipped";

/// The root of the workspace. Cargo names the folder of this package when it starts the program. So a program that was built in another
/// clone, into a folder that both share, works on the clone in which it is started.
pub fn root() -> &'static Path {
    static ROOT: LazyLock<PathBuf> = LazyLock::new(|| {
        let package = env::var_os("CARGO_MANIFEST_DIR");
        let package = package.unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
        PathBuf::from(package).parent().map(PathBuf::from).unwrap_or_default()
    });
    &ROOT
}

/// The directory of build results.
pub fn target_dir() -> Result<PathBuf> {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(dir) => std::path::absolute(dir).context("CARGO_TARGET_DIR"),
        None => Ok(root().join("target")),
    }
}

/// A directory of build results, made if it does not exist.
pub fn folder(name: impl AsRef<Path>) -> Result<PathBuf> {
    let folder = target_dir()?.join(name);
    fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

/// The cargo that started this program, with arguments that have no spaces inside.
pub fn cargo(arguments: &str) -> Command {
    let mut command = command(env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo")));
    command.args(arguments.split(' '));
    command
}

/// Makes a command compile without the flags of the environment and without incremental compilation, as two packages of [`SHIPPED`] would
/// be compiled: both leave traces in the result.
pub fn plain(command: &mut Command) -> &mut Command {
    command.env("CARGO_INCREMENTAL", "0").env_remove("RUSTFLAGS");
    command.env_remove("CARGO_ENCODED_RUSTFLAGS")
}

/// A command that runs in the root of the workspace.
pub fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// Prints and runs one command of a task.
pub fn step(name: &str, command: &mut Command) -> Result<()> {
    println!("\n==> {name}: {}", shown(command));
    let began = Instant::now();
    let status = command.status().with_context(|| format!("cannot run: {command:?}"))?;
    ensure!(status.success(), "{name}, {status}\n    {command:?}");
    println!("    {name}: done in {:.0} s", began.elapsed().as_secs_f64());
    Ok(())
}

/// A task of this program that runs beside the steps of another one, see [`Steps::beside`].
pub struct Beside {
    name: &'static str,
    began: Instant,
    child: Result<Child>,
    output: PathBuf,
}

/// The steps of a task that goes on when one fails.
pub struct Steps {
    began: Instant,
    /// Name, time, and result; `None` if the step was not run, because a step that it needs failed.
    ended: Vec<(&'static str, Duration, Option<Result<()>>)>,
}

impl Steps {
    /// A task that begins now.
    pub fn new() -> Self {
        Self { began: Instant::now(), ended: Vec::new() }
    }

    /// Starts a task of this program, which uses one core while the next steps use the other. [`Self::joined`] waits for it and
    /// prints its output.
    pub fn beside(name: &'static str, task: &[&str]) -> Result<Beside> {
        println!("\n==> {name}: cargo xtask {}, beside the next steps", task.join(" "));
        let output = folder("beside")?.join(name.replace(' ', "-"));
        let file = File::create(&output).with_context(|| output.display().to_string())?;
        let mut command = command(env::current_exe()?);
        command.args(task).stdin(Stdio::null()).stderr(file.try_clone()?).stdout(file);
        let child = command.spawn().with_context(|| format!("cannot run: {command:?}"));
        Ok(Beside { name, began: Instant::now(), child, output })
    }

    /// Waits for a task that runs beside the steps; returns `Some` if it passed.
    pub fn joined(&mut self, beside: Beside) -> Option<()> {
        let Beside { name, began, child, output } = beside;
        let status = child.and_then(|mut child| Ok(child.wait()?));
        let result = status.and_then(|status| {
            println!("\n==> {name}: its output\n{}", fs::read_to_string(output)?);
            ensure!(status.success(), "{name}, {status}");
            Ok(())
        });
        self.note(name, began, Some(result))
    }

    /// Runs a step; returns its result, if it passes.
    pub fn run<T>(&mut self, name: &'static str, step: impl FnOnce() -> Result<T>) -> Option<T> {
        self.with(Some(()), name, |()| step())
    }

    /// Runs a step that is one command.
    pub fn command(&mut self, name: &'static str, mut command: Command) {
        self.run(name, || step(name, &mut command));
    }

    /// Runs a step with the result of an earlier one, if that passed.
    pub fn with<N, T>(
        &mut self,
        needed: Option<N>,
        name: &'static str,
        step: impl FnOnce(N) -> Result<T>,
    ) -> Option<T> {
        println!("\n===== {name}");
        let began = Instant::now();
        self.note(name, began, needed.map(step))
    }

    /// Notes and prints the result of a step; returns it, if the step passed.
    fn note<T>(
        &mut self,
        name: &'static str,
        began: Instant,
        ended: Option<Result<T>>,
    ) -> Option<T> {
        let time = began.elapsed();
        let how = match &ended {
            Some(Ok(_)) => "ok",
            Some(Err(_)) => "FAILED",
            None => "not run",
        };
        println!("===== {name}: {how} after {:.0} s", time.as_secs_f64());
        let (passed, ended) = match ended {
            Some(Ok(passed)) => (Some(passed), Some(Ok(()))),
            Some(Err(error)) => (None, Some(Err(error))),
            None => (None, None),
        };
        self.ended.push((name, time, ended));
        passed
    }

    /// Prints the result and the time of every step and of the whole command.
    ///
    /// # Errors
    /// The steps that failed or were not run, with the reasons.
    pub fn end(&self, command: &str) -> Result<()> {
        println!("\n{:<34}{:>8}  result", "step", "seconds");
        let mut failed = Vec::new();
        for (name, time, ended) in &self.ended {
            let result = match ended {
                Some(Ok(())) => "ok",
                Some(Err(error)) => {
                    failed.push(format!("{name}: {error:#}"));
                    "FAILED"
                }
                None => {
                    failed.push(format!("{name}: not run"));
                    "not run: a step that it needs failed"
                }
            };
            println!("{name:<34}{:>8.0}  {result}", time.as_secs_f64());
        }
        let seconds = self.began.elapsed().as_secs_f64();
        println!("{command:<34}{seconds:>8.0}");
        let all = self.ended.len();
        ensure!(failed.is_empty(), "{} of {all} steps:\n{}", failed.len(), failed.join("\n"));
        Ok(())
    }
}

/// The program and its arguments, without paths and variables.
pub fn shown(command: &Command) -> String {
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

/// The output of a command, without surrounding white space.
///
/// # Errors
/// The command does not run, or it fails: its whole output.
pub fn said(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("cannot run: {command:?}"))?;
    let decoded = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    let (text, errors) = (decoded(&output.stdout), decoded(&output.stderr));
    ensure!(output.status.success(), "{}: {text}{errors}\n    {command:?}", output.status);
    Ok(text)
}

/// The output of a program with these arguments.
pub fn output(program: &str, arguments: &[&str]) -> Result<String> {
    said(command(program).args(arguments))
}

/// Fails if probe-rs is not installed.
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
    fn all_steps_run_and_those_that_failed_are_named() {
        let mut steps = Steps::new();
        assert_eq!(steps.run("one", || Ok(1)), Some(1));
        let image = steps.run("image", || -> Result<u8> { bail!("no linker") });
        assert_eq!(steps.with(image, "size", |_| -> Result<()> { unreachable!() }), None);
        let mut ran = false;
        steps.run("last", || {
            ran = true;
            Ok(())
        });
        assert!(ran);
        let names: Vec<_> = steps.ended.iter().map(|(name, ..)| *name).collect();
        assert_eq!(names, ["one", "image", "size", "last"]);
        let error = steps.end("a task").unwrap_err().to_string();
        assert_eq!(error, "2 of 4 steps:\nimage: no linker\nsize: not run");
    }

    #[test]
    fn a_failing_step_names_the_whole_command() {
        let error = step("nothing", Command::new("false").env("A", "b")).unwrap_err();
        assert!(error.to_string().ends_with("\n    A=\"b\" \"false\""), "{error}");
    }
}
