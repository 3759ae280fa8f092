//! Developer tasks: `cargo xtask`, `cargo firmware`.

mod board;
mod budget;
mod by_name;
mod dist;
mod elf;
mod files;
mod fmu;
mod foreign;
mod fuzz;
mod image;
mod lines;
mod map;
mod paths;
mod prove;
mod python;
mod results;
mod rooms;
mod run;
mod sbom;
mod seal;
mod sections;
mod size;
mod sources;
mod stack;
mod surface;
mod toolchain;
mod tools;
mod uses;
mod web;
#[cfg(test)]
mod words;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::{Args, Parser};

/// Developer tasks.
#[derive(Parser)]
#[command(bin_name = "cargo xtask")]
enum Task {
    /// Everything a change must pass beside `cargo test`: format, modules, lints, documentation, page, firmware, and the firmware on the
    /// virtual board. All steps run, and the failed ones are named at the end. Installs missing programs, or prints the command to type
    Test,
    /// Before a commit: format, modules, lines, lints, unit tests, procedures. These need neither image nor emulator
    Quick,
    /// Lints the firmware, builds and checks the images of all boards, prints the memory use of the first one
    Images,
    /// Builds and checks the image for a board (also: cargo firmware)
    Firmware(Which),
    /// Builds the image of a board, writes it through a debug probe and shows its log
    Flash {
        /// Name of the board; without it the board of the image in the flash
        #[arg(long, value_name = "NAME")]
        board: Option<String>,
        /// Write the image although the flash holds one for another board
        #[arg(long)]
        other_board: bool,
    },
    /// Builds the images and tests them on the virtual board
    Board,
    /// Reads the registers of a real board through its debug probe and compares them with the virtual board's
    BenchDump(Which),
    /// Runs third-party programs on the virtual board: examples of stm32g4xx-hal, and programs of this project on embassy-stm32
    Foreign,
    /// Estimates the cycles of the control interrupt on the virtual board; fails above the budgets
    Cycles,
    /// Runs mbpoll, pymodbus and LinuxCNC's vfdb_vfd on the bus of the virtual board. Installs them from Debian and PyPI
    Bus,
    /// Injects faults into the image on the virtual board
    Campaign {
        /// The faults
        #[command(flatten)]
        faults: board::Faults,
        /// The board
        #[command(flatten)]
        which: Which,
    },
    /// Fuzzes console, bus, saved settings, learned values, stream, and the files of the simulator
    Fuzz {
        /// Seconds for each of the six
        #[arg(default_value_t = 300)]
        seconds: u32,
    },
    /// Prints the use of each memory by the image; fails above the budgets
    Size,
    /// Counts lines of code, documentation, comments and tests; fails above the budgets
    Lines,
    /// Fails if modules of a crate refer to each other in a circle, if too many files name a module of the firmware, or if the control
    /// crate has too many public items
    Rooms,
    /// Changes drive-core in many places and runs its tests on each change; fails if under 90 % are caught. Installs cargo-mutants from
    /// crates.io
    Mutants {
        /// Share of the places, K/N with K from 0
        #[arg(default_value = "7/45")]
        shard: String,
    },
    /// Builds the pages in docs/. Installs mdbook from crates.io
    Book,
    /// Makes pages and pictures of them in Chromium, which it installs; fails if a page overflows at 420 pixels or the text of a plot is
    /// too small. Drives the live page on the virtual board
    Pages,
    /// Builds the drive in a browser, firmware and motor on the live page: a folder of static files
    Web,
    /// Builds the wheel for Python into target/wheels and tests it in a clean environment. Installs maturin, numpy and more from PyPI
    Python,
    /// Packs drive and motor as FMUs into target/fmu and tests them. Installs FMPy and libcosimpy from PyPI
    Fmu,
    /// Makes the folder of a release: images, programs, drive in a browser, book, lists of crates, licences, check sums
    Dist(dist::Dist),
    /// Long proofs in shards, which a later call continues. Without a name it lists them, and the results that are older than their inputs
    Prove {
        /// Name of the proof; `results` measures the older results again
        name: Option<String>,
        /// Part of its shards, K/N with K from 1
        #[arg(default_value = "1/1")]
        part: String,
    },
}

/// Choice of a board.
#[derive(Args)]
struct Which {
    /// Name of the board
    #[arg(long, value_name = "NAME", default_value = image::REFERENCE)]
    board: String,
    /// Name of the image: a file of src/images. `--loop printed` selects the image with the loop of the dissertation
    #[arg(long, alias = "loop", value_name = "NAME", default_value = image::FULL)]
    image: String,
}

impl Which {
    fn image(&self) -> Result<PathBuf> {
        image::build_for(&toolchain::for_target()?, &self.board, &self.image)
    }
}

fn main() -> ExitCode {
    match run(Task::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nFAILED: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    match task {
        Task::Test => test(),
        Task::Quick => quick(),
        Task::Images => images(),
        Task::Firmware(which) => which.image().map(|elf| println!("{}", elf.display())),
        Task::Flash { board, other_board } => image::flash(board.as_deref(), other_board),
        Task::Board => board::test(&image::build_all(&toolchain::for_target()?)?),
        Task::BenchDump(which) => by_name::bench_dump(&which.image()?, &which.board),
        Task::Foreign => foreign::test(),
        Task::Cycles => board::cycles(&image::build()?),
        Task::Bus => by_name::bus(&image::build()?),
        Task::Campaign { faults, which } => board::campaign(&which.image()?, &which.board, &faults),
        Task::Fuzz { seconds } => fuzz::fuzz(seconds),
        Task::Size => size::report_all(),
        Task::Lines => lines::report(),
        Task::Rooms => rooms::check().and_then(|()| uses::check()).and_then(|()| surface::check()),
        Task::Mutants { shard } => tools::mutants(&shard),
        Task::Book => tools::book().map(drop),
        Task::Pages => by_name::pages(),
        Task::Web => web::build().map(drop),
        Task::Python => python::test(),
        Task::Fmu => fmu::test(),
        Task::Dist(options) => dist::dist(&options),
        Task::Prove { name: None, .. } => prove::list(),
        Task::Prove { name: Some(name), part } => prove::prove(&name, &part),
    }
}

/// Runs the checks that a typical change is most likely to break, without image and emulator.
fn quick() -> Result<()> {
    let mut steps = run::Steps::new();
    before_tests(&mut steps);
    steps.command("unit tests", run::cargo("test --lib --bins --no-fail-fast"));
    steps.command("procedures", run::cargo("test --test procedures"));
    steps.end("cargo xtask quick")
}

/// Format, modules, lines and lints of the main workspace.
fn before_tests(steps: &mut run::Steps) {
    steps.run("third-party programs", toolchain::ensure_format_and_lints);
    steps.command("format", run::cargo("fmt --all --check"));
    let fuzz = run::cargo("fmt --check --manifest-path fuzz/Cargo.toml");
    steps.command("format of the fuzz targets", fuzz);
    steps.run("rooms", rooms::check);
    steps.run("modules of the firmware", uses::check);
    steps.run("lines", lines::report);
    steps.command("lints", run::cargo("clippy --workspace --all-targets -- -D warnings"));
}

/// Lints the firmware, builds and checks the images of all boards, and prints the memory that the reference board's uses.
fn images() -> Result<()> {
    let target = toolchain::for_target()?;
    // The firmware itself does not enable this feature of the control crates.
    let log = ["--package=induction-drive", "--features=drive-core/defmt", "--no-deps"];
    for (name, features) in [("all", "--all-features"), ("no", "--no-default-features")] {
        let mut lints = target.cargo("clippy")?;
        let lints = lints.args(log).args([features, "--", "-D", "warnings"]);
        run::step(&format!("lints of the firmware with {name} modules"), lints)?;
    }
    let full = image::build_all(&target)?;
    size::report(&full, image::FULL)
}

/// Tests the control without its optional blocks, and with each of them alone.
fn blocks() -> Result<()> {
    ["", "flying-start", "position", "power-limit", "printed", "vf"].iter().try_for_each(|block| {
        let tests = "test --package induction-drive-core --no-default-features --lib --features";
        run::step(&format!("control with {block:?} alone"), run::cargo(tests).arg(block))
    })
}

/// Runs the checks that `cargo test` leaves out, the quick ones first. All of them run, also when one fails.
fn test() -> Result<()> {
    let mut steps = run::Steps::new();
    // Run one after the other, because they are installed.
    let target = steps.run("compiler for the controller", toolchain::for_target);
    let compiler = steps.run("compiler for the emulator", toolchain::ensure_c_compiler);
    // An image is linked on one core.
    let images = run::Steps::beside("images", &["images"])?;
    before_tests(&mut steps);
    let crates = "clippy --package induction-drive-core --package induction-drive-settings";
    let features = run::cargo(&format!("{crates} --all-features -- -D warnings"));
    steps.command("lints with all features", features);
    steps.run("control with each block alone", blocks);
    let mut documentation = run::cargo("doc --workspace --no-deps");
    documentation.env("RUSTDOCFLAGS", "-D warnings");
    steps.command("documentation", documentation);
    steps.run("public interface of the control", surface::check);

    let rest = "--test page --test clones --bin xtask --no-fail-fast";
    let rest = run::cargo(&format!("test {} {rest}", run::TESTED));
    steps.command("tests of page and tasks", rest);
    let tables = ["commands_of", "the_page_prints", "every_printed", "the_errata", "the_figures"];
    let mut documents = run::cargo("test --test simulator --");
    documents.args(["--ignored", "--nocapture"]).args(tables);
    steps.command("commands and tables of the documents", documents);

    let check = "format, lints, documentation of the virtual board, tests of its chip";
    steps.with(compiler, check, |()| board::check());
    let built = steps.joined(images);
    let elf = target.zip(built).map(|(target, ())| target.image()).transpose()?;
    let elf = elf.as_deref();
    steps.with(elf, "the image on the virtual board", board::test);
    steps.with(elf, "campaign of faults", |elf| {
        let (count, class) = (board::CAMPAIGN / 20, String::new());
        let faults = board::Faults { count, seed: 1, class, rpm: None };
        board::campaign(elf, image::REFERENCE, &faults)
    });
    steps.with(elf, "cycles of the control interrupt", board::cycles);

    steps.end("cargo xtask test")?;
    println!("\nPASSED: everything but the host tests, which are `cargo test`");
    Ok(())
}
