//! Developer tasks: `cargo xtask`, `cargo firmware`, `cargo flash`.

mod board;
mod control;
mod fuzz;
mod image;
mod paths;
mod run;
mod stack;
mod toolchain;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;

use run::Step;

const HELP: &str = "\
Usage: cargo xtask <task>

  test      everything a change must pass: format, lints, host tests, documentation, firmware, the
            firmware on the virtual board; gets what is missing from the system, or says what to type
  firmware  builds the image for the board (also: cargo firmware)
  flash     builds it, writes it through a debug probe, shows its log (also: cargo flash)
  board     builds the image and tests it on the virtual board
  cycles    counts what the control interrupt costs on the virtual board, and fails when it rises
  campaign [N] [SEED] [CLASS]
            injects N faults (2000) into the image on the virtual board, the first with SEED (1), only
            of the classes whose name contains CLASS
  fuzz [S]  fuzzes console and saved settings, S seconds each (300)
  size      shows what the image takes of each memory, and fails above the limits";

/// Faults of a whole campaign; `test` injects a twentieth.
const CAMPAIGN: u32 = 2000;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match arguments[..] {
        ["test"] => test(),
        ["firmware"] => image::build().map(|elf| println!("{}", elf.display())),
        ["fuzz"] => fuzz::fuzz(300),
        ["fuzz", seconds] if seconds.parse::<u32>().is_ok() => {
            fuzz::fuzz(seconds.parse().unwrap_or_default())
        }
        ["flash"] => image::flash(),
        ["size"] => image::build().and_then(|elf| image::report_size(&elf)),
        ["board"] => image::build().and_then(|elf| board::test(&elf)),
        ["campaign", ref rest @ ..]
            if rest.len() <= 3 && rest.iter().take(2).all(|n| n.parse::<u32>().is_ok()) =>
        {
            let number = |n: usize, default| {
                rest.get(n).and_then(|text| text.parse().ok()).unwrap_or(default)
            };
            let class = rest.get(2).copied().unwrap_or("");
            let faults = board::Faults { count: number(0, CAMPAIGN), seed: number(1, 1), class };
            image::build().and_then(|elf| board::campaign(&elf, &faults))
        }
        ["cycles"] => image::build().and_then(|elf| board::cycles(&elf)),
        [] | ["help" | "-h" | "--help"] => {
            println!("{HELP}");
            Ok(())
        }
        _ => {
            eprintln!("unknown task: {}\n\n{HELP}", arguments.join(" "));
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nFAILED: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Everything a change must pass, the quick things first; stops at the first failure.
fn test() -> Result<()> {
    let began = Instant::now();
    toolchain::ensure_format_and_lints()?;
    toolchain::ensure_c_compiler()?;
    let host = run::cargo();

    Step::new("format").run(host().args(["fmt", "--all", "--check"]))?;
    Step::new("lints").run(host().args([
        "clippy",
        "--workspace",
        "--all-targets",
        "--",
        "-D",
        "warnings",
    ]))?;
    Step::new("host tests").run(host().args([
        "test",
        "--workspace",
        // It needs the image.
        "--exclude",
        "virtual-board",
    ]))?;
    Step::new("documentation")
        .run(host().args(["doc", "--workspace", "--no-deps"]).env("RUSTDOCFLAGS", "-D warnings"))?;

    let target = toolchain::for_target()?;
    Step::new("drive-core for the controller")
        .run(target.cargo("build")?.args(["--package", "drive-core"]))?;
    Step::new("lints of the firmware").run(target.cargo("clippy")?.args([
        "--package",
        "induction-drive",
        "--no-deps",
        "--",
        "-D",
        "warnings",
    ]))?;
    let elf = image::build_with(&target)?;
    image::report_size(&elf)?;
    board::test(&elf)?;
    board::campaign(&elf, &board::Faults { count: CAMPAIGN / 20, seed: 1, class: "" })?;
    board::cycles(&elf)?;

    println!("\nPASSED: everything, in {} s", began.elapsed().as_secs());
    Ok(())
}
