//! The virtual board as a program; `cargo xtask` starts it.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;
use virtual_board::power_stage::REFERENCE;
use virtual_board::{Image, PowerStage, campaign};

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
    }
    Ok(())
}
