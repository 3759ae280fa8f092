//! `cargo sim console`: talks to a drive at a serial port, of a board or a pseudo-terminal of the virtual board.
//!
//! Lines that begin with `!` are commands of this program ([`own`]); all others go to the drive. [`link`] moves lines,
//! `editor` edits them; further, [`catalogue`] has commands and settings, for the completion, [`transfer`] the restoring of
//! settings, and [`trace`] plots.

pub mod catalogue;
mod editor;
pub mod link;
pub mod own;
pub mod session;
pub mod trace;
pub mod transfer;
pub mod update;

use std::io::IsTerminal as _;

use crate::prelude::*;
use link::Link;
use session::Session;

/// Options of the console.
#[derive(Args)]
pub struct Options {
    /// Serial port: /dev/ttyACM0, COM3, or the pseudo-terminal that `cargo sim board` prints
    #[arg(long, value_name = "PATH")]
    pub port: String,
    /// Bits per second
    #[arg(long, value_name = "N", default_value_t = 115_200)]
    pub baud: u32,
    /// Sends a line, prints the answer and ends; can be repeated. Stops at the first answer `error:`, with exit code 1
    #[arg(long = "command", value_name = "LINE")]
    pub commands: Vec<String>,
}

/// Longest wait for a byte before the reader checks whether it should end.
const READ: Duration = Duration::from_millis(100);

/// Opens the port and talks to the drive: with the commands of the options, with the lines of standard input if that is
/// not a terminal, or with a person.
///
/// # Errors
/// [`Error::Refused`] if the port cannot be opened; [`Error::Internal`] if the drive does not answer or, without a
/// person, answers with an error.
pub fn run(options: &Options) -> Result<(), Error> {
    let (reader, writer) = open(&options.port, options.baud)?;
    if options.commands.is_empty() && std::io::stdin().is_terminal() {
        return editor::run(&options.port, |show| Link::new(reader, writer, show));
    }
    // Standard output gets only answers.
    let link = Link::new(reader, writer, |line: &str| eprintln!("{line}"));
    let mut session = Session::new(link);
    if options.commands.is_empty() {
        let lines = std::io::stdin().lines().map_while(Result::ok);
        session.play(lines)
    } else {
        session.play(options.commands.iter().cloned())
    }
}

/// A serial port.
pub type Port = Box<dyn serialport::SerialPort>;

/// Opens both directions of a port.
///
/// # Errors
/// [`Error::Refused`] if it cannot be opened.
pub fn open(path: &str, baud: u32) -> Result<(Port, Port), Error> {
    let refused = |why: serialport::Error| {
        let ports = serialport::available_ports().unwrap_or_default();
        let names: Vec<_> = ports.into_iter().map(|port| port.port_name).collect();
        let known = match names[..] {
            [] => "no serial port is found".to_owned(),
            _ => format!("there are {}", names.join(", ")),
        };
        Error::Refused(format!("--port {path}: {why}; {known}"))
    };
    let builder = serialport::new(path, baud).timeout(READ);
    // A pseudo-terminal that was opened exclusively stays exclusive if this program is killed.
    let port = builder.exclusive(false).open().map_err(refused)?;
    let other = port.try_clone().map_err(refused)?;
    Ok((port, other))
}
