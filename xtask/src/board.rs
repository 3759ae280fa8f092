//! The virtual board: tests with the finished image on an emulated controller, faults, and the execution time of its control interrupt.

use std::path::Path;
use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::{budget, image, run, toolchain};

/// Environment variable by which the tests find the image.
pub const ELF: &str = "INDUCTION_DRIVE_ELF";

/// Environment variable by which the tests find the images of the other boards: a folder with one folder per board.
const BOARDS: &str = "INDUCTION_DRIVE_BOARDS";

/// Faults of a whole campaign; `cargo xtask test` injects a twentieth.
pub const CAMPAIGN: u32 = 2000;

/// Runs the tests of the virtual board with this image of the reference board and the images of the other boards in `target/boards`.
pub fn test(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let mut command = cargo("test --release --tests --no-fail-fast");
    command.env(ELF, elf).env(BOARDS, run::folder(image::BOARDS)?);
    run::step("the images on the virtual board", &mut command)
}

/// Format, lints and documentation of the virtual board and of its chip, and the tests of the chip, which need no image. All use the profile
/// of the tests, so that the emulator is built once.
pub fn check() -> Result<()> {
    let words = [
        "fmt --all --check",
        "clippy --release --workspace --all-targets -- -D warnings",
        "doc --release --workspace --no-deps",
        "test --release --package stm32g4-unicorn",
    ];
    words.into_iter().try_for_each(|words| {
        run::step("virtual board", cargo(words).env("RUSTDOCFLAGS", "-D warnings"))
    })
}

/// Prints the estimated cycles of the control interrupt of this image; fails above the budgets.
pub fn cycles(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let budget::Cycles { to_last_compare, whole } = budget::read()?.cycles;
    let mut test = ignored_test("the_control_interrupt_keeps");
    test.env(ELF, elf)
        .env("TO_LAST_COMPARE", to_last_compare.to_string())
        .env("WHOLE", whole.to_string());
    run::step("cycles of the control interrupt", &mut test)
}

/// Injects faults into this image; fails if the outputs stay on with wrong control beyond a limit.
pub fn campaign(elf: &Path, board: &str, faults: &Faults) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let Faults { count, seed, class, rpm } = faults;
    let mut test = ignored_test("faults_end_in_time");
    test.env(ELF, elf).env("BOARD", board).env("CLASS", class);
    test.env("COUNT", count.to_string()).env("SEED", seed.to_string());
    test.envs(rpm.map(|rpm| ("RPM", rpm.to_string())));
    run::step("campaign of faults", &mut test)
}

/// Faults of a campaign.
#[derive(Args)]
pub struct Faults {
    /// Number of faults
    #[arg(default_value_t = CAMPAIGN)]
    pub count: u32,
    /// Seed of the first fault
    #[arg(default_value_t = 1)]
    pub seed: u32,
    /// Only classes of faults whose name contains this
    #[arg(default_value = "")]
    pub class: String,
    /// Speed of the shaft, rpm: 850 to 3500; without it the scene is at rest and at low speed
    #[arg(long)]
    pub rpm: Option<u32>,
}

/// An ignored test with images, run by its name.
pub fn ignored_test(name: &str) -> Command {
    cargo(&format!("test --release --test image {name} -- --ignored --nocapture"))
}

/// A cargo command in the workspace of the virtual board.
pub fn cargo(arguments: &str) -> Command {
    let mut command = run::cargo(arguments);
    command.current_dir(run::root().join("hil-sim/virtual-board"));
    command
}
