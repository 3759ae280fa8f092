//! `cargo xtask python`: the module of Python, as a wheel, and its tests in an environment that has nothing else.

use std::env::consts::EXE_SUFFIX;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use glob::glob;

use crate::{dist, paths, run};

/// The program that makes wheels.
const MATURIN: &str = "maturin==1.16.0";
/// The tests, and what they need beside the wheel.
const TESTS: &str = "python/tests";

/// Builds the wheel of this version into `target/wheels`, with the program that it is compared with, and runs the tests.
pub fn test() -> Result<()> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let option = paths::option(&host, &[])?;
    let options = ["--locked", "--profile", dist::PROFILE, &option];
    let mut program = dist::plain(run::cargo("build --package hil-sim"));
    run::step("program", program.args(options))?;

    let wheels = concat!("wheels/*-", env!("CARGO_PKG_VERSION"), "-*.whl");
    let wheels = run::target_dir()?.join(wheels);
    let found = || glob(&wheels.to_string_lossy());
    found()?.try_for_each(|old| fs::remove_file(old?).context("an old wheel"))?;
    let mut build = dist::plain(environment("build", &[MATURIN])?);
    build.args(["-m", "maturin", "build", "--manifest-path", "python/Cargo.toml", "--out"]);
    run::step("wheel", build.arg(run::folder("wheels")?).args(options))?;
    let wheel = found()?.next().context("maturin has made no wheel of this version")??;
    println!("{}: {} bytes", wheel.display(), fs::metadata(&wheel)?.len());

    let requirements = format!("{TESTS}/requirements.txt");
    let mut test = environment("clean", &[&wheel.to_string_lossy(), "-r", &requirements])?;
    let program = run::target_dir()?.join(dist::PROFILE).join(format!("hil-sim{EXE_SUFFIX}"));
    test.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", TESTS]).env("HIL_SIM", program);
    run::step("tests of the wheel", &mut test)
}

/// The Python of a new environment with these packages.
fn environment(name: &str, packages: &[&str]) -> Result<Command> {
    let folder = run::folder("python")?.join(name);
    let python = if cfg!(windows) { "python" } else { "python3" };
    run::step(name, run::command(python).args(["-m", "venv", "--clear"]).arg(&folder))?;
    let own: PathBuf = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    let mut install = run::command(&own);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    run::step(name, install.args(packages))?;
    Ok(run::command(own))
}
