//! `cargo xtask python`: the module for Python, as a wheel, and its tests in an environment with nothing else.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use glob::glob;

use crate::{paths, run};

/// The wheels of this version, sorted by system, and behind them the source distribution.
pub fn wheels() -> Result<Vec<PathBuf>> {
    let names = concat!("wheels/*-", env!("CARGO_PKG_VERSION"), "[-.]*");
    let found = glob(&run::target_dir()?.join(names).to_string_lossy())?;
    found.collect::<Result<_, _>>().context("wheels")
}

/// Builds the wheel of this version and its sources into `target/wheels`, and the program that it is compared with, and runs the tests.
pub fn test() -> Result<()> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let options = ["--locked", "--profile", run::SHIPPED, &paths::option(&host)?];
    run::step("program", run::plain(&mut run::cargo("build --package hil-sim")).args(options))?;
    wheels()?.iter().try_for_each(fs::remove_file)?;
    let mut build = environment("build", &["maturin==1.16.0", "twine==7.0.0"])?;
    build.args(["-m", "maturin", "build", "--manifest-path", "python/Cargo.toml", "--out"]);
    build.arg(run::folder("wheels")?).args(options);
    run::step("wheel", run::plain(&mut build))?;
    let built = run::target_dir()?.join(run::SHIPPED);
    paths::check(&fs::read(built.join("libinduction_drive_python.so")).unwrap_or_default())?;
    let wheel = wheels()?.pop().context("maturin has made no wheel of this version")?;
    println!("{}: {} bytes", wheel.display(), fs::metadata(&wheel)?.len());
    let mut sources = run::command(build.get_program());
    sources.args(["-m", "maturin", "sdist", "--manifest-path", "python/Cargo.toml", "--out"]);
    run::step("source distribution", sources.arg(run::folder("wheels")?))?;
    let mut check = run::command(build.get_program());
    run::step("texts for PyPI", check.args(["-m", "twine", "check", "--strict"]).args(wheels()?))?;

    let needed = [&*wheel.to_string_lossy(), "-r", "python/tests/requirements.txt"];
    let mut test = environment("clean", &needed)?;
    test.args(["-m", "pytest", "-q", "-rP", "-p", "no:cacheprovider", "python/tests"]);
    test.env("HIL_SIM", built.join("hil-sim"));
    run::step("tests of the wheel", &mut test)
}

/// The Python of a new environment with these packages, on Linux and macOS.
pub fn environment(name: &str, packages: &[&str]) -> Result<Command> {
    let folder = run::folder("python")?.join(name);
    run::step(name, run::command("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    let python = folder.join("bin/python");
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    run::step(name, run::command(&python).args(install).args(packages))?;
    Ok(run::command(python))
}
