//! The image for the board: builds and checks it, and writes it to the board.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::toolchain::{self, Target};
use crate::{paths, run, seal, sections, sources, stack};

/// The name that probe-rs has for the controller of the board.
pub const CHIP: &str = "STM32G474RETx";

/// The variable by which the firmware learns its board when it is built.
const BOARD: &str = "INDUCTION_DRIVE_BOARD";
/// The directory of build results with the images of the other boards, one folder a board.
pub const BOARDS: &str = "boards";
/// The board whose image is built unless another is named.
pub const REFERENCE: &str = "reference";

/// The names of the boards, which `src/boards.rs` lists.
pub fn boards() -> Result<Vec<String>> {
    let source = sources::read("src/boards.rs")?;
    let (_, list) = source.split_once("ALL_NAMES: &str =").context("src/boards.rs: ALL_NAMES")?;
    let list = list.split('"').nth(1).unwrap_or_default();
    Ok(list.split_whitespace().map(str::to_owned).collect())
}

/// Builds and checks the image of the reference board; returns its path.
pub fn build() -> Result<PathBuf> {
    build_for(&toolchain::for_target()?, REFERENCE)
}

/// Builds and checks the images of all boards; returns the path of that of the reference board.
pub fn build_all(target: &Target) -> Result<PathBuf> {
    // The reference last: each leaves its image at the same path.
    for board in boards()?.iter().filter(|board| *board != REFERENCE) {
        build_for(target, board)?;
    }
    build_for(target, REFERENCE)
}

/// Builds and checks the image of a board. The path of the last image built is always the same; images of other boards
/// than the reference are copied to `target/boards/NAME/`, and that path is returned.
pub fn build_for(target: &Target, board: &str) -> Result<PathBuf> {
    let known = boards()?;
    ensure!(
        known.iter().any(|name| name == board),
        "no board {board}: one of {}",
        known.join(", ")
    );
    let mut command = target.cargo("build")?;
    command.args(["--package", "induction-drive"]).env(BOARD, board);
    run::step(&format!("firmware for {board}"), &mut command)?;
    let elf = target.image()?;
    check(&elf)?;
    seal::seal(&elf).context("the check sum of the image")?;
    if board == REFERENCE {
        return Ok(elf);
    }
    let copy = run::folder(format!("{BOARDS}/{board}"))?.join("induction-drive");
    for extension in ["", "map", "bin", "hex"] {
        fs::copy(elf.with_extension(extension), copy.with_extension(extension))
            .with_context(|| copy.display().to_string())?;
    }
    Ok(copy)
}

/// Checks an image: what the control interrupt calls, paths of this machine, sections.
fn check(elf: &Path) -> Result<()> {
    let bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    stack::check_interrupts(&bytes).context("the interrupts")?;
    paths::check(&bytes)?;
    sections::check(&sources::read("memory.x")?, &sources::read(elf.with_extension("map"))?)
}

/// Builds the image of a board, writes it there and shows its log until interrupted.
pub fn flash(board: &str) -> Result<()> {
    // Asked before the build, which takes minutes.
    run::probe_rs()?;
    let elf = build_for(&toolchain::for_target()?, board)?;
    run::step("flash", run::command("probe-rs").args(["run", "--chip", CHIP]).arg(elf))
}
