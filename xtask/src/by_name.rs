//! Ignored tests that need a third-party program, run by name.

use std::fs;
use std::path::Path;

use anyhow::Result;

use crate::{board, image, python, run, toolchain, web};

/// Pages, by the arguments of `cargo sim run` that make them.
const PAGES: [&str; 4] =
    ["torque-steps", "speed-profile", "monte-carlo --set runs=12", "identify-machine"];

/// The client of the field bus from PyPI.
const PYMODBUS: &str = "pymodbus>=3.10,<4";

/// Compares numbers and pictures of the theory with its script; makes pages of the simulator in `target/pages`, measures them in Chromium, and
/// drives the live page on the virtual board.
pub fn pages() -> Result<()> {
    let script = ["docs/pictures/theory.py", "--check"];
    run::step("theory", run::command("python3").args(script))?;
    toolchain::ensure_chromium()?;
    toolchain::ensure_c_compiler()?;
    let folder = run::folder("pages")?;
    for arguments in PAGES {
        let mut command = run::cargo("run --quiet --bin hil-sim -- run");
        let command = command.args(arguments.split(' ')).arg("--out").arg(&folder);
        run::step(arguments, command.stdout(std::process::Stdio::null()))?;
    }
    // The page of the last session with the virtual board, if there was one.
    let session = run::root().join("out/board.html");
    if session.is_file() {
        fs::copy(session, folder.join("board.html"))?;
    }
    let (elf, web) = (image::build()?, web::build()?);
    // Run one after the other, because the virtual board keeps pace with real time.
    let options = "--ignored --nocapture --test-threads=1";
    let mut test = run::cargo(&format!("test {} --test page -- {options}", run::TESTED));
    run::step(
        "pages in Chromium",
        test.env("PAGES", &folder).env("LIVE_ELF", elf).env("WEB", web),
    )?;
    println!("\npictures: {}", folder.display());
    Ok(())
}

/// Compares the registers of a real board with those of the virtual board that has this image.
pub fn bench_dump(elf: &Path, name: &str) -> Result<()> {
    run::probe_rs()?;
    let mut test = board::ignored_test("every_register");
    test.env(board::ELF, elf).env("BOARD", name).env("CHIP", image::CHIP);
    run::step("registers of the board", &mut test)
}

/// Runs the clients of the field bus with this image. Installs those that are missing.
pub fn bus(elf: &Path) -> Result<()> {
    toolchain::ensure_c_compiler()?;
    toolchain::ensure_bus_clients()?;
    let python = python::environment("bus", &[PYMODBUS, "pyserial"])?;
    let mut test = board::ignored_test("bus_clients");
    test.env(board::ELF, elf).env("PYTHON", python.get_program());
    run::step("clients of the bus", &mut test)
}
