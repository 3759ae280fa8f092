//! The virtual board as a program; `cargo xtask` starts it.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use virtual_board::{Image, campaign, cycles};

/// Runs the firmware's ELF on an emulated board with a simulated motor.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Faults, thousands of them: outputs off in time, or control correct.
    Campaign {
        /// The ELF.
        elf: PathBuf,
        /// How many.
        #[arg(default_value_t = 2000)]
        count: u64,
        /// Seed of the first; each has the next one.
        #[arg(default_value_t = 1)]
        seed: u64,
        /// Only the classes whose name contains this.
        #[arg(long, default_value = "")]
        class: String,
    },
    /// Counts what the control interrupt costs.
    Cycles {
        /// The ELF.
        elf: PathBuf,
        /// A table of before: fails if a line is over 5 % above it.
        #[arg(long)]
        against: Option<PathBuf>,
        /// Shows the functions of the blocks as well.
        #[arg(long)]
        functions: bool,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("FAILED: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<()> {
    match arguments.task {
        Task::Campaign { elf, count, seed, class } => {
            let choice = campaign::Choice { count, seed, class };
            println!("{}", campaign::bounds());
            println!("{}", campaign::run(|| Image::open(&elf), &choice)?);
        }
        Task::Cycles { elf, against, functions } => {
            let lines = cycles::measure(|| Image::open(&elf))?;
            print!("{}", cycles::table(&lines));
            if functions {
                lines.iter().for_each(|line| print!("\n{}", cycles::functions(line)));
            }
            if let Some(path) = against {
                let before = std::fs::read_to_string(&path);
                let before = before.with_context(|| path.display().to_string())?;
                cycles::compare(&lines, &before).with_context(|| path.display().to_string())?;
            }
        }
    }
    Ok(())
}
