//! Ignored tests that need a program of others, run by name.

use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::{board, image, run, toolchain};

/// Pages, by the arguments of `cargo sim run` that make them.
const PAGES: [&str; 4] =
    ["torque-steps", "speed-profile", "monte-carlo --set runs=12", "identify-machine"];

/// Makes pages of the simulator in `target/pages`, measures them in Chromium, and drives the live page on the virtual board.
pub fn pages() -> Result<()> {
    toolchain::ensure_chromium()?;
    toolchain::ensure_c_compiler()?;
    let folder = run::folder("pages")?;
    for arguments in PAGES {
        let mut command = run::cargo("run --quiet --release --package hil-sim -- run");
        let command = command.args(arguments.split(' ')).arg("--out").arg(&folder);
        run::step(arguments, command.stdout(std::process::Stdio::null()))?;
    }
    // The page of the last session with the virtual board, if there was one.
    let session = run::root().join("out/board.html");
    if session.is_file() {
        fs::copy(session, folder.join("board.html"))?;
    }
    let elf = image::build()?;
    // One after the other: the virtual board keeps pace with the clock.
    let test = "test --release --package drive-live --test page -- --ignored --nocapture";
    let mut test = run::cargo(test);
    test.arg("--test-threads=1");
    run::step("pages in Chromium", test.env("PAGES", &folder).env("LIVE_ELF", elf))?;
    println!("\npictures: {}", folder.display());
    Ok(())
}

/// Compares the registers of a real board with those of the virtual board that has this image.
pub fn bench_dump(elf: &Path, name: &str) -> Result<()> {
    run::probe_rs()?;
    let mut test =
        board::cargo("test --release --test image every_register -- --ignored --nocapture")?;
    test.env(board::ELF, elf).env("BOARD", name).env("CHIP", image::CHIP);
    run::step("registers of the board", &mut test)
}

/// Runs the clients of the field bus, those that are installed, with this image.
pub fn bus(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let mut test =
        board::cargo("test --release --test image bus_clients -- --ignored --nocapture")?;
    run::step("clients of the bus", test.env(board::ELF, elf))
}
