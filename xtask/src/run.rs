//! Running commands, and saying so.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, bail};

/// The root of the workspace.
pub fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here)
}

/// Where cargo puts what it builds.
pub fn target_dir() -> Result<PathBuf> {
    match env::var_os("CARGO_TARGET_DIR") {
        Some(dir) => std::path::absolute(dir).context("CARGO_TARGET_DIR"),
        None => Ok(root().join("target")),
    }
}

/// The cargo that started us.
pub fn cargo() -> impl Fn() -> Command {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    move || command(&cargo)
}

/// A command that runs in the root of the workspace.
pub fn command(program: impl AsRef<std::ffi::OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// One step of a task.
pub struct Step<'a> {
    what: &'a str,
}

impl<'a> Step<'a> {
    /// A step that does `what`.
    pub fn new(what: &'a str) -> Self {
        Self { what }
    }

    /// Says what it does, and does it.
    pub fn run(self, command: &mut Command) -> Result<()> {
        let line = shown(command);
        println!("\n==> {}: {line}", self.what);
        let began = Instant::now();
        let status = command.status().with_context(|| format!("cannot run: {line}"))?;
        if !status.success() {
            bail!("{}, {status}\n    {line}", self.what);
        }
        println!("    {}: done in {:.0} s", self.what, began.elapsed().as_secs_f64());
        Ok(())
    }
}

/// The command as one would type it.
fn shown(command: &Command) -> String {
    let path = env::var("PATH").unwrap_or_default();
    let mut words: Vec<String> = command
        .get_envs()
        .filter_map(|(name, value)| Some((name.to_string_lossy(), value?.to_string_lossy())))
        .map(|(name, value)| match value.strip_suffix(&path) {
            Some(front) if name == "PATH" => format!("PATH={front}$PATH"),
            _ => format!("{name}={}", quoted(&value)),
        })
        .collect();
    let program = Path::new(command.get_program());
    // The rustup toolchain's own cargo is `cargo` to whoever types it.
    let system = program.starts_with("/usr/bin");
    let name = if system { program.as_os_str() } else { program.file_name().unwrap_or_default() };
    words.push(name.to_string_lossy().into_owned());
    words.extend(command.get_args().map(|argument| quoted(&argument.to_string_lossy())));
    words.join(" ")
}

fn quoted(word: &str) -> String {
    if word.contains(' ') { format!("'{word}'") } else { word.to_owned() }
}

/// Whether a command runs and succeeds; its output is not shown.
pub fn succeeds(program: &str, arguments: &[&str]) -> bool {
    output(program, arguments).is_some()
}

/// What a command writes, if it runs and succeeds.
pub fn output(program: &str, arguments: &[&str]) -> Option<String> {
    let output = command(program).args(arguments).stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_shown_as_one_would_type_them() {
        let mut command = Command::new("/some/toolchain/bin/cargo");
        command.args(["doc", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings").env_remove("GONE");
        assert_eq!(shown(&command), "RUSTDOCFLAGS='-D warnings' cargo doc --no-deps");
    }

    #[test]
    fn a_failing_step_names_the_command() {
        let error = Step::new("nothing").run(&mut Command::new("false")).unwrap_err();
        assert!(error.to_string().ends_with("\n    false"), "{error}");
    }
}
