//! The virtual board as a program; `cargo xtask` starts it.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};
use virtual_board::{Image, cycles};

/// Runs the firmware's ELF on an emulated board with a simulated motor.
#[derive(Parser)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
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
