//! The virtual board: tests with the finished image on an emulated controller, and what its control
//! interrupt costs.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::run::{self, Step};
use crate::toolchain;

/// Environment variable by which the tests find the image.
const ELF: &str = "INDUCTION_DRIVE_ELF";
/// The table of cycles that must not rise.
const TABLE: &str = "hil-sim/virtual-board/cycles.txt";

/// Runs the tests of the virtual board with this image.
pub fn test(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    Step::new("the image on the virtual board")
        .run(on_the_board(["test", "--release", "--package", "virtual-board"]).env(ELF, elf))
}

/// Prints what the control interrupt of this image costs; fails if it costs over 5 % more than the table
/// that is checked in.
pub fn cycles(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    Step::new("cycles of the control interrupt").run(
        on_the_board(["run", "--release", "--package", "virtual-board"])
            .args(["--", "cycles"])
            .arg(elf)
            .args(["--against", TABLE]),
    )
}

/// Which faults.
pub struct Faults<'a> {
    /// How many.
    pub count: u32,
    /// Seed of the first.
    pub seed: u32,
    /// Only of the classes whose name contains this.
    pub class: &'a str,
}

/// Injects faults into this image on the virtual board; fails if any is not dealt with in its time.
pub fn campaign(elf: &Path, faults: &Faults) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    Step::new("campaign of faults").run(
        on_the_board(["run", "--release", "--package", "virtual-board"])
            .args(["--", "campaign"])
            .arg(elf)
            .args([faults.count.to_string(), faults.seed.to_string()])
            .args(["--class", faults.class]),
    )
}

fn on_the_board<const N: usize>(arguments: [&str; N]) -> Command {
    let mut command = run::cargo()();
    command.args(arguments);
    command
}
