//! The image for the board: builds and checks it, and writes it to the board.

use std::fs;
use std::io::ErrorKind;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::toolchain::{self, Target};
use crate::{control, paths, run, sections, sources};

/// The name that probe-rs has for the controller of the board.
const CHIP: &str = "STM32G474RETx";

/// Builds and checks the image; returns its path.
pub fn build() -> Result<PathBuf> {
    build_with(&toolchain::for_target()?)
}

/// Builds and checks the image with this compiler; returns its path.
pub fn build_with(target: &Target) -> Result<PathBuf> {
    run::step("firmware", target.cargo("build")?.args(["--package", "induction-drive"]))?;
    let elf = target.image()?;
    let bytes = fs::read(&elf).with_context(|| elf.display().to_string())?;
    control::check(&bytes).context("the control interrupt")?;
    paths::check(&bytes)?;
    sections::check(&sources::read("memory.x")?, &sources::read(elf.with_extension("map"))?)?;
    Ok(elf)
}

/// Builds the image, writes it to the board and shows its log until interrupted.
pub fn flash() -> Result<()> {
    // Asked before the build, which takes minutes.
    let probe = run::command("probe-rs").arg("--version").output();
    if probe.is_err_and(|error| error.kind() == ErrorKind::NotFound) {
        bail!("probe-rs is missing. Type:\n    cargo install probe-rs-tools --locked");
    }
    let elf = build()?;
    run::step("flash", run::command("probe-rs").args(["run", "--chip", CHIP]).arg(elf))
}
