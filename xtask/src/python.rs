//! `cargo xtask python`: the module of Python, as a wheel, and its tests in an environment that has nothing else.

use std::env::consts::EXE_SUFFIX;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use glob::glob;

use crate::{paths, run};

/// The program that makes wheels.
const MATURIN: &str = "maturin==1.16.0";
/// The tests, and what they need beside the wheel.
const TESTS: &str = "python/tests";

/// The wheels of this version, by systems.
pub fn wheels() -> Result<Vec<PathBuf>> {
    let names = concat!("wheels/*-", env!("CARGO_PKG_VERSION"), "-*.whl");
    let found = glob(&run::target_dir()?.join(names).to_string_lossy())?;
    found.collect::<Result<_, _>>().context("wheels")
}

/// Builds the wheel of this version into `target/wheels`, with the program that it is compared with, and runs the tests.
pub fn test() -> Result<()> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let options = ["--locked", "--profile", run::SHIPPED, &paths::option(&host, &[])?];
    run::step("program", run::plain(&mut run::cargo("build --package hil-sim")).args(options))?;
    wheels()?.iter().try_for_each(fs::remove_file)?;
    let mut build = environment("build", &[MATURIN])?;
    build.args(["-m", "maturin", "build", "--manifest-path", "python/Cargo.toml", "--out"]);
    build.arg(run::folder("wheels")?).args(options);
    run::step("wheel", run::plain(&mut build))?;
    let built = run::target_dir()?.join(run::SHIPPED);
    paths::check(&fs::read(built.join("libinduction_drive_python.so")).unwrap_or_default())?;
    let wheels = wheels()?;
    let wheel = wheels.first().context("maturin has made no wheel of this version")?;
    println!("{}: {} bytes", wheel.display(), fs::metadata(wheel)?.len());

    let requirements = format!("{TESTS}/requirements.txt");
    let mut test = environment("clean", &[&wheel.to_string_lossy(), "-r", &requirements])?;
    test.args(["-m", "pytest", "-q", "-rP", "-p", "no:cacheprovider", TESTS]);
    test.env("HIL_SIM", built.join(format!("hil-sim{EXE_SUFFIX}")));
    run::step("tests of the wheel", &mut test)
}

/// The Python of a new environment with these packages.
fn environment(name: &str, packages: &[&str]) -> Result<Command> {
    let folder = run::folder("python")?.join(name);
    let [python, own] =
        if cfg!(windows) { ["python", "Scripts/python.exe"] } else { ["python3", "bin/python"] };
    run::step(name, run::command(python).args(["-m", "venv", "--clear"]).arg(&folder))?;
    let own = folder.join(own);
    let mut install = run::command(&own);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    run::step(name, install.args(packages))?;
    Ok(run::command(own))
}
