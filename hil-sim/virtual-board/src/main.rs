//! The virtual board as a program; `cargo xtask` starts it.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;
use virtual_board::power_stage::REFERENCE;
use virtual_board::{Image, PowerStage, campaign, cycles, dump};

/// Runs the firmware's ELF on an emulated board with a simulated motor.
#[derive(Parser)]
enum Task {
    /// Injects faults and checks that after each one outputs go off in time or control is correct.
    Campaign {
        /// The ELF.
        elf: PathBuf,
        #[command(flatten)]
        selection: campaign::Selection,
        /// The board for which the ELF was built, with a motor that suits it.
        #[arg(long, default_value = REFERENCE.name)]
        board: String,
    },
    /// Prints the registers of a board that has started, one per line: name, address, value, bits to compare.
    Dump {
        /// The ELF.
        elf: PathBuf,
        /// The board for which the ELF was built.
        #[arg(long, default_value = REFERENCE.name)]
        board: String,
    },
    /// Counts the cycles of the control interrupt; fails if they exceed the budgets.
    Cycles {
        /// The ELF.
        elf: PathBuf,
        /// Budget to the last compare value, cycles.
        to_compares: u32,
        /// Budget of the whole interrupt, cycles.
        whole: u32,
        /// Shows the functions of the blocks as well.
        #[arg(long)]
        functions: bool,
    },
}

fn main() -> ExitCode {
    match run(Task::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("FAILED: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> Result<()> {
    match task {
        Task::Campaign { elf, selection, board } => {
            let stage = PowerStage::named(&board)?;
            println!("{}", campaign::bounds(selection.rpm.is_some()));
            let open = || Image::open(&elf);
            for table in campaign::run(open, stage, &selection, &[|_, _, _| ()])? {
                println!("{}", table?);
            }
        }
        Task::Dump { elf, board } => {
            let lines = dump::lines(Image::open(&elf)?, PowerStage::named(&board)?)?;
            lines.iter().for_each(|line| println!("{line}"));
        }
        Task::Cycles { elf, to_compares, whole, functions } => {
            let rows = cycles::measure(|| Image::open(&elf))?;
            print!("{}", cycles::table(&rows));
            if functions {
                rows.iter().for_each(|row| print!("\n{}", cycles::functions(row)));
            }
            cycles::check(&rows, to_compares, whole)?;
        }
    }
    Ok(())
}
