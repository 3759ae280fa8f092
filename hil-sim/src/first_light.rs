//! `cargo sim first-light`: first power-up of a board, step by step, with a person at the bench. It tells what to do
//! and what to measure, sends the lines of the console, judges, and stops on doubt. It writes one test record (the
//! evidence file).

pub mod evidence;
pub mod person;
pub mod table;
pub mod walk;
pub mod wire;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};

use person::Terminal;
use table::Table;
use walk::Walk;
use wire::Port;

use crate::prelude::*;

/// Options of a first light.
#[derive(Args, Clone)]
pub struct Options {
    /// Serial port: /dev/ttyACM0, COM3, or the pseudo-terminal that `cargo sim board` prints
    #[arg(long, value_name = "PATH")]
    pub port: String,
    /// Bits per second
    #[arg(long, value_name = "N", default_value_t = 115_200)]
    pub baud: u32,
    /// Expected board [default: the board of the image]
    #[arg(long, value_name = "NAME")]
    pub board: Option<String>,
    /// File of the test record; an existing one is continued at the first step that was not passed
    #[arg(long, value_name = "FILE", default_value = "out/first-light.toml")]
    pub evidence: PathBuf,
    /// Instruments, supply and motor, for a new test record
    #[arg(long, value_name = "TEXT", default_value = "not stated")]
    pub bench: String,
    /// Skips saliency self-commissioning and trace; the test record says `skipped`
    #[arg(long)]
    pub skip_learning: bool,
}

/// Returns a flag that is set when the person interrupts.
///
/// # Errors
/// [`Error::Internal`].
pub fn interruptible() -> Result<Arc<AtomicBool>, Error> {
    let interrupted = Arc::<AtomicBool>::default();
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, interrupted.clone())
            .map_err(|why| Error::Internal(format!("cannot listen for Ctrl-C: {why}")))?;
    }
    Ok(interrupted)
}

/// Walks through all steps that are missing in the test record.
///
/// # Errors
/// [`Error::Lost`] for a step that was not passed, after the drive was stopped; [`Error::Refused`] if the port cannot
/// be opened, the drive does not answer, or it is not the drive of the test record.
pub fn run(options: &Options) -> Result<(), Error> {
    let table = Table::read()?;
    let interrupted = interruptible()?;
    let wire = Port::new(&options.port, options.baud, interrupted.clone())?;
    Walk::new(&table, (wire, Terminal::new()?), options.clone(), interrupted)?.run()?;
    println!("\nAll steps were passed or skipped: {}", options.evidence.display());
    Ok(())
}
