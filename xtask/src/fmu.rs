//! `cargo xtask fmu`: drive and motor as functional mock-up units, and their test under FMPy and libcosim.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::fs;
use std::path::PathBuf;

use anyhow::Result;

use crate::{paths, python, run};

/// Packs both into the folder `target/fmu`.
pub fn build() -> Result<PathBuf> {
    let host = run::output("rustc", &["--print", "host-tuple"])?;
    let mut build = run::cargo("build --locked --package induction-drive-fmu --profile");
    build.args([run::SHIPPED, &paths::option(&host)?]);
    run::step("library", run::plain(&mut build))?;
    let (built, folder) = (run::target_dir()?.join(run::SHIPPED), run::folder("fmu")?);
    let library = built.join(format!("{DLL_PREFIX}induction_drive_fmu{DLL_SUFFIX}"));
    paths::check(&fs::read(&library)?)?;
    let tables = built.join(format!("induction-drive-fmu{EXE_SUFFIX}"));
    let mut pack = run::command("python3");
    run::step("FMUs", pack.arg("hil-sim/fmu/pack.py").args([&library, &tables, &folder]))?;
    Ok(folder)
}

/// Packs both and tests them in a clean environment under both importers.
pub fn test() -> Result<()> {
    let folder = build()?;
    let mut test = python::environment("fmu", &["-r", "hil-sim/fmu/tests/requirements.txt"])?;
    test.args(["-m", "pytest", "-q", "-rP", "-p", "no:cacheprovider", "hil-sim/fmu/tests"]);
    run::step("tests of the FMUs", test.env("FMUS", folder))
}
