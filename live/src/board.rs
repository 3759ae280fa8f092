//! The virtual board as a child of this program.

use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use clap::Parser;
use hil_sim::board::{Options, attach};

use crate::shared::Shared;

/// Longest wait for the end of the board, which writes its report.
const END: Duration = Duration::from_secs(5);

#[derive(Parser)]
#[command(name = "cargo live --", no_binary_name = true)]
struct Arguments {
    #[command(flatten)]
    options: Options,
}

/// A running board. It ends when this value is dropped, and with this program, whose end closes the board's standard input.
pub struct VirtualBoard {
    child: Child,
    input: Option<ChildStdin>,
    /// Its serial port.
    pub port: String,
}

impl VirtualBoard {
    /// Builds the missing programs and starts the board, with the options of `cargo sim board`. The flux of its motor goes to `shared`.
    ///
    /// # Errors
    /// An option is refused, a build fails, or the board does not start.
    pub fn start(arguments: &[String], shared: &Arc<Shared>) -> Result<Self> {
        let Arguments { options } = Arguments::try_parse_from(arguments)?;
        let mut child = attach(&options, arguments)?;
        let input = child.stdin.take();
        let mut lines =
            BufReader::new(child.stdout.take().context("no output of the board")?).lines();
        let first = lines.next().context("the virtual board has ended at once")??;
        let Some(port) = first.strip_prefix("console: ").map(str::to_owned) else {
            bail!("the virtual board says: {first}");
        };
        let shared = shared.clone();
        std::thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                if let Some(flux) = line.strip_prefix("flux ").and_then(numbers) {
                    shared.flux(flux);
                }
            }
        });
        Ok(Self { child, input, port })
    }
}

fn numbers(text: &str) -> Option<[f64; 3]> {
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    numbers.ok()?.try_into().ok()
}

impl Drop for VirtualBoard {
    fn drop(&mut self) {
        if let Some(mut input) = self.input.take() {
            let _ = input.write_all(b"!quit\n");
        }
        let began = Instant::now();
        while matches!(self.child.try_wait(), Ok(None)) && began.elapsed() < END {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
