//! The image for the board: builds and checks it, and writes it to the board.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;

use crate::toolchain::{self, Target};
use crate::{paths, run, seal, sections, sources, stack};

/// Name of the board's controller in probe-rs.
pub const CHIP: &str = "STM32G474RETx";

/// The variable that tells the firmware its board when it is built.
const BOARD: &str = "INDUCTION_DRIVE_BOARD";
/// The directory of build results with the images of the other boards, one folder per board.
pub const BOARDS: &str = "boards";
/// The board whose image is built unless another is named.
pub const REFERENCE: &str = "reference";

/// The image that is built unless another is named, and all images: a file of `src/images` each.
pub const FULL: &str = "full";
pub const IMAGES: [&str; 3] = ["drive-and-log", "printed", FULL];

/// A selection of the firmware's parts.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// The program.
    program: String,
    /// Features of the package.
    features: Vec<String>,
    /// Its budgets.
    pub bytes: Bytes,
}

/// Memory of an image, bytes.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bytes {
    pub control_code: u64,
    /// Both banks.
    pub flash: u64,
    pub flash_bank: u64,
    pub stack: u64,
    pub static_ram: u64,
}

/// Reads the file of an image.
pub fn read(image: &str) -> Result<Image> {
    let file = format!("src/images/{image}.toml");
    let text = sources::read(&file);
    let text = text.with_context(|| format!("no image {image}: one of {}", IMAGES.join(", ")))?;
    toml::from_str(&text).context(file)
}

/// The names of the boards, which `src/boards.rs` lists.
pub fn boards() -> Result<Vec<String>> {
    let source = sources::read("src/boards.rs")?;
    let (_, list) = source.split_once("ALL_NAMES: &str =").context("src/boards.rs: ALL_NAMES")?;
    let list = list.split('"').nth(1).unwrap_or_default();
    Ok(list.split_whitespace().map(str::to_owned).collect())
}

/// Builds and checks the image of the reference board; returns its path.
pub fn build() -> Result<PathBuf> {
    build_for(&toolchain::for_target()?, REFERENCE, FULL)
}

/// Builds and checks the images of all boards, and all images of the reference board; returns the path of its full image.
pub fn build_all(target: &Target) -> Result<PathBuf> {
    // The full image of the reference board comes last, because each build leaves its image at the same path.
    for board in boards()?.iter().filter(|board| *board != REFERENCE) {
        build_for(target, board, FULL)?;
    }
    for image in IMAGES.iter().filter(|image| **image != FULL) {
        build_for(target, REFERENCE, image)?;
    }
    build_for(target, REFERENCE, FULL)
}

/// Builds and checks an image of a board. The path of the last image built is always the same; images of other boards
/// than the reference are copied to `target/boards/BOARD/`, other images than the full one to `target/boards/IMAGE/`, and that path is
/// returned.
pub fn build_for(target: &Target, board: &str, image: &str) -> Result<PathBuf> {
    let known = boards()?;
    ensure!(
        known.iter().any(|name| name == board),
        "no board {board}: one of {}",
        known.join(", ")
    );
    let mut command = target.cargo("rustc")?;
    let Image { program, features, .. } = read(image)?;
    command.args(["--package", "induction-drive", "--bin", &program, "--no-default-features"]);
    command.args(["--features", &features.join(",")]).env(BOARD, board);
    let elf = target.image()?.with_file_name(&program);
    // Each image has its own map, because cargo links an image only if it changed.
    let map = elf.with_file_name(format!("image-{image}.map"));
    command.arg("--").arg(format!("-Clink-arg=-Map={}", map.display()));
    run::step(&format!("firmware for {board}, image {image}"), &mut command)?;
    fs::copy(&map, elf.with_extension("map")).context("the linker's map")?;
    check(&elf, image)?;
    seal::seal(&elf).context("the check sum of the image")?;
    let name = match (board, image) {
        (REFERENCE, FULL) => return Ok(elf),
        (_, FULL) => board.to_owned(),
        (REFERENCE, _) => image.to_owned(),
        _ => format!("{board}-{image}"),
    };
    let copy = run::folder(format!("{BOARDS}/{name}"))?.join("induction-drive");
    for extension in ["", "map", "bin", "hex"] {
        fs::copy(elf.with_extension(extension), copy.with_extension(extension))
            .with_context(|| copy.display().to_string())?;
    }
    Ok(copy)
}

/// Checks an image: the calls of the control interrupt, paths of this machine, sections.
fn check(elf: &Path, image: &str) -> Result<()> {
    let bytes = fs::read(elf).with_context(|| elf.display().to_string())?;
    stack::check_interrupts(&bytes).context("the interrupts")?;
    paths::check(&bytes)?;
    // The patterns of memory.x are those of the full image.
    if image != FULL {
        return Ok(());
    }
    sections::check(&sources::read("memory.x")?, &sources::read(elf.with_extension("map"))?)
}

/// The mark before the name of the board in the first page of an image, and the length of the name in bytes (`src/boards/identity.rs`).
const MAGIC: &[u8] = b"idboard1";
const NAME: usize = 32;

/// The board to flash: `wanted`, or the board of the image in the flash, whose first page is given.
///
/// # Errors
/// The flash names no board, or another one than `wanted`.
fn board_to_flash(wanted: Option<&str>, page: &[u8], other_board: bool) -> Result<String> {
    let at = page.windows(MAGIC.len()).position(|window| window == MAGIC);
    let name = at.and_then(|at| page.get(at + MAGIC.len()..)?.get(..NAME));
    let there = name.map(|name| String::from_utf8_lossy(name).trim_end_matches('\0').to_owned());
    match (wanted, there) {
        (None, None) => bail!("the flash names no board: say which one it is with --board NAME"),
        (None, Some(there)) => Ok(there),
        (Some(wanted), Some(there)) if wanted != there && !other_board => bail!(
            "the image in the flash is for the board {there}, not {wanted}: on another board an image may switch gates on; \
             leave --board out, or add --other-board"
        ),
        (Some(wanted), _) => Ok(wanted.to_owned()),
    }
}

/// Builds the image of a board, writes it to the board and shows its log until interrupted. The board is that of the image in the flash,
/// unless another is named.
pub fn flash(board: Option<&str>, other_board: bool) -> Result<()> {
    // Checked before the build, which takes minutes.
    run::probe_rs()?;
    let read = ["read", "--chip", CHIP, "b8", "0x08000000", "2048"];
    let page = page(&run::output("probe-rs", &read)?);
    let board = board_to_flash(board, &page, other_board)?;
    let elf = build_for(&toolchain::for_target()?, &board, FULL)?;
    run::step("flash", run::command("probe-rs").args(["run", "--chip", CHIP]).arg(elf))
}

/// The bytes that `probe-rs read b8` has printed: hexadecimal, separated by spaces.
fn page(printed: &str) -> Vec<u8> {
    let words = printed.split_whitespace().filter(|word| word.len() == 2);
    words.filter_map(|word| u8::from_str_radix(word, 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_flashed_with_its_own_image() {
        let image = |name: &str| [&[7; 40][..], MAGIC, name.as_bytes(), &[0; NAME]].concat();
        let ask = |wanted, page: &[u8], other| board_to_flash(wanted, page, other).ok();
        let one = image("reference");
        assert_eq!(ask(None, &one, false).as_deref(), Some("reference"));
        assert_eq!(ask(Some("reference"), &one, false).as_deref(), Some("reference"));
        assert_eq!(ask(Some("other"), &one, false), None);
        assert_eq!(ask(Some("other"), &one, true).as_deref(), Some("other"));
        assert_eq!(ask(None, &[0xff; 2048], false), None);
        assert_eq!(ask(Some("other"), &[0xff; 2048], false).as_deref(), Some("other"));
        let why = board_to_flash(Some("other"), &one, false).unwrap_err().to_string();
        assert!(why.contains("reference, not other") && why.contains("--other-board"), "{why}");
        assert_eq!(page("69 64 ff\n0a"), [0x69, 0x64, 0xff, 0x0a]);
    }
}
