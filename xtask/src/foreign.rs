//! Third-party programs for the virtual board: the examples of `stm32g4xx-hal` that need no wiring, from the source in the registry's
//! cache, and small programs on `embassy-stm32`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::board;
use crate::run::{self, TARGET};
use crate::toolchain::{self, Target};

/// The programs on `embassy-stm32`.
const EMBASSY: &str = "hil-sim/virtual-board/tests/foreign";
/// Examples of the HAL that need no log, and those that need one.
const PLAIN: &[&str] = &["blinky", "clockout", "comp", "comp_w_dac", "dac", "opamp", "pwm"];
const LOGGED: &[&str] = &["adc-one-shot", "independent_watchdog"];
/// Environment variable by which the test finds the programs.
const FOLDER: &str = "INDUCTION_DRIVE_FOREIGN";

/// Builds all programs and runs them on the virtual board.
pub fn test() -> Result<()> {
    toolchain::ensure_c_compiler()?;
    let target = toolchain::for_target()?;
    let folder = run::folder("foreign")?;
    let programs = run::folder("foreign/programs")?;
    let built = folder.join(TARGET).join("release");
    let hal = copy_of_hal(&folder)?;
    for (features, examples) in [("stm32g474", PLAIN), ("stm32g474,defmt", LOGGED)] {
        let mut build = cargo(&target, &hal, &folder);
        build.args(["--features", features]);
        build.args(examples.iter().flat_map(|example| ["--example", example]));
        run::step("examples of stm32g4xx-hal", &mut build)?;
        for example in examples {
            let to = programs.join(format!("hal-{example}"));
            fs::copy(built.join("examples").join(example), to)?;
        }
    }
    let embassy = run::root().join(EMBASSY);
    run::step("programs on embassy-stm32", &mut cargo(&target, &embassy, &folder))?;
    for source in fs::read_dir(embassy.join("src/bin"))? {
        let source = source?.path();
        let name = source.file_stem().context("no name")?.to_string_lossy().into_owned();
        fs::copy(built.join(&name), programs.join(format!("embassy-{name}")))?;
    }
    let mut test = board::ignored_test("foreign");
    run::step("third-party programs on the virtual board", test.env(FOLDER, programs))
}

/// A cargo command that builds a workspace for the microcontroller.
fn cargo(target: &Target, workspace: &Path, folder: &Path) -> Command {
    let mut command = target.bare("build");
    command.current_dir(workspace).args(["--release", "--target", TARGET, "--target-dir"]);
    // Replaces the flags in .cargo/config.toml, which are the firmware's.
    command.arg(folder).env("RUSTFLAGS", "-Ctarget-cpu=cortex-m4 -Clink-arg=--nmagic");
    command
}

/// A copy of the HAL's source, as a workspace of its own.
fn copy_of_hal(folder: &Path) -> Result<PathBuf> {
    let metadata = run::output("cargo", &["metadata", "--format-version", "1"])?;
    // Finds the path of its manifest, without a parser for the whole output.
    let is_it = |text: &&str| text.ends_with("Cargo.toml") && text.contains("/stm32g4xx-hal-");
    let source = metadata.split('"').find(is_it);
    let source = Path::new(source.context("no stm32g4xx-hal")?).parent().context("no folder")?;
    let copy = folder.join("stm32g4xx-hal");
    if copy.exists() {
        fs::remove_dir_all(&copy)?;
    }
    run::step("copy of stm32g4xx-hal", run::command("cp").arg("-r").arg(source).arg(&copy))?;
    let manifest = copy.join("Cargo.toml");
    let text = fs::read_to_string(&manifest)?;
    fs::write(manifest, text + "\n[workspace]\n")?;
    Ok(copy)
}
