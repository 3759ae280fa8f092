//! The virtual board: tests with the finished image on an emulated controller, faults, and the time that
//! its control interrupt takes.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::{run, toolchain};

/// Environment variable by which the tests find the image.
const ELF: &str = "INDUCTION_DRIVE_ELF";

/// Runs the tests of the virtual board with this image.
pub fn test(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let mut command = run::cargo("test --release --package virtual-board");
    run::step("the image on the virtual board", command.env(ELF, elf))
}

/// Prints the estimated cycles of the control interrupt of this image; fails above the limits.
pub fn cycles(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    run::step("cycles of the control interrupt", &mut program("cycles", elf))
}

/// Injects faults into this image; fails if the outputs stay on with wrong control beyond a bound.
pub fn campaign(elf: &Path, count: u32, seed: u32, class: &str) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    run::step("campaign of faults", faults(elf, count, seed).args(["--class", class]))
}

/// The command that injects `count` faults, the first with this seed.
pub fn faults(elf: &Path, count: u32, seed: u32) -> Command {
    let mut command = program("campaign", elf);
    command.args([count.to_string(), seed.to_string()]);
    command
}

fn program(task: &str, elf: &Path) -> Command {
    let mut command = run::cargo("run --release --package virtual-board --");
    command.arg(task).arg(elf);
    command
}
