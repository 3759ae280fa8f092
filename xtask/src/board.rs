//! The virtual board: tests with the finished image on an emulated controller, faults, and the time that
//! its control interrupt takes.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::toolchain::Target;
use crate::{image, run, toolchain};

/// Environment variable by which the tests find the image.
const ELF: &str = "INDUCTION_DRIVE_ELF";

/// Environment variable by which they find the images of the other boards: a folder with one folder a board.
const BOARDS: &str = "INDUCTION_DRIVE_BOARDS";

/// Builds the images of all boards and runs the tests of the virtual board with them.
pub fn test(target: &Target) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    for board in image::boards()?.iter().filter(|board| *board != image::REFERENCE) {
        image::build_for(target, board)?;
    }
    // Last: the others leave their image at its path.
    let elf = image::build_with(target)?;
    let mut command = run::cargo("test --release --package virtual-board");
    command.env(ELF, elf).env(BOARDS, image::folder()?);
    run::step("the images on the virtual board", &mut command)
}

/// Prints the estimated cycles of the control interrupt of this image; fails above the limits.
pub fn cycles(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    run::step("cycles of the control interrupt", &mut program("cycles", elf))
}

/// Injects faults into this image; fails if the outputs stay on with wrong control beyond a bound.
pub fn campaign(elf: &Path, board: &str, count: u32, seed: u32, class: &str) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    run::step("campaign of faults", faults(elf, board, count, seed).args(["--class", class]))
}

/// The command that injects `count` faults into the image of a board, the first with this seed.
pub fn faults(elf: &Path, board: &str, count: u32, seed: u32) -> Command {
    let mut command = program("campaign", elf);
    command.args([count.to_string(), seed.to_string()]).args(["--board", board]);
    command
}

/// A task of the virtual board as a program.
pub fn program(task: &str, elf: &Path) -> Command {
    let mut command = run::cargo("run --release --package virtual-board --");
    command.arg(task).arg(elf);
    command
}
