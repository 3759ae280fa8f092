//! The virtual board: tests with the finished image on an emulated controller, faults, and the time that
//! its control interrupt takes.

use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::toolchain::Target;
use crate::{budget, image, run, times, toolchain};

/// Environment variable by which the tests find the image.
pub const ELF: &str = "INDUCTION_DRIVE_ELF";

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
    let mut command = cargo("test --release --tests --no-fail-fast")?;
    command.env(ELF, elf).env(BOARDS, run::folder(image::BOARDS)?);
    times::test("the images on the virtual board", command)
}

/// Format, lints and documentation of the virtual board, in the profile of its tests, so that the emulator is built once.
pub fn check() -> Result<()> {
    let words =
        ["fmt --check", "clippy --release --all-targets -- -D warnings", "doc --release --no-deps"];
    words.into_iter().try_for_each(|words| {
        run::step("virtual board", cargo(words)?.env("RUSTDOCFLAGS", "-D warnings"))
    })
}

/// Prints the estimated cycles of the control interrupt of this image; fails above the budgets.
pub fn cycles(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let budget::Cycles { to_last_compare, whole } = budget::read()?.cycles;
    let mut command = program("cycles", elf)?;
    command.args([to_last_compare.to_string(), whole.to_string()]);
    run::step("cycles of the control interrupt", &mut command)
}

/// Injects faults into this image; fails if the outputs stay on with wrong control beyond a bound.
pub fn campaign(elf: &Path, board: &str, faults: &Faults, class: &str) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    run::step("campaign of faults", faults.command(elf, board)?.args(["--class", class]))
}

/// Faults of a campaign.
pub struct Faults {
    /// Their number.
    pub count: u32,
    /// Seed of the first.
    pub seed: u32,
    /// Speed of the shaft, rpm on four poles; none is the usual scene at low speed.
    pub rpm: Option<u32>,
}

impl Faults {
    /// The command that injects them into the image of a board.
    pub fn command(&self, elf: &Path, board: &str) -> Result<Command> {
        let mut command = program("campaign", elf)?;
        command.args([self.count.to_string(), self.seed.to_string()]).args(["--board", board]);
        command.args(self.rpm.map(|rpm| format!("--rpm={rpm}")));
        Ok(command)
    }
}

/// A task of the virtual board as a program.
pub fn program(task: &str, elf: &Path) -> Result<Command> {
    let mut command = cargo("run --release --")?;
    command.arg(task).arg(elf);
    Ok(command)
}

/// A cargo command in the workspace of the virtual board. Its build results are beside those of the main one.
pub fn cargo(arguments: &str) -> Result<Command> {
    let mut command = run::cargo(arguments);
    command.current_dir(run::root().join("hil-sim/virtual-board"));
    command.env("CARGO_TARGET_DIR", run::target_dir()?);
    Ok(command)
}
