//! The command line; see [`hil_sim::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    hil_sim::cli::main()
}
