//! Functions for the tests.

pub mod dump;
pub mod pair;
pub mod program;
pub mod script;

use anyhow::{Context as _, Result, bail, ensure};
use hil_sim::Config;
use virtual_board::{Board, Image, Options};

use pair::Pair;

/// Longest time from a reset to the greeting, and from a request to its answer, periods.
const LONGEST: u64 = 30_000;

/// Returns a started board with the image that was built last, together with its shadow.
pub fn pair(config: &Config, seed: u64) -> Result<Pair> {
    Pair::new(Image::built()?, Options::new(config, seed))
}

/// Returns such a board that regulates torque without a sensor.
pub fn regulating(seed: u64) -> Result<Pair> {
    let mut pair = pair(&Config::default(), seed)?;
    pair.start_torque()?;
    Ok(pair)
}

/// Runs until the console prints a line with this text; returns all its output.
pub fn until_said(board: &mut Board, text: &str) -> Result<String> {
    until_within(board, text, LONGEST)
}

/// As [`until_said`], within this many periods.
pub fn until_within(board: &mut Board, text: &str, periods: u64) -> Result<String> {
    let mut said = String::new();
    for _ in 0..periods / 60 {
        board.run_periods(60)?;
        while board.next_period().is_some() {}
        said += &board.take_console();
        if said.contains(text) && said.ends_with('\n') {
            return Ok(said);
        }
    }
    bail!("no {text:?} in {said:?}")
}

/// Types a line after the console has finished its output; returns the output up to a line with this text.
pub fn say(board: &mut Board, line: &str, until: &str) -> Result<String> {
    board.run_periods(120)?;
    board.take_console();
    board.type_line(line);
    until_said(board, until).context(line.to_owned())
}

/// Runs for some periods, and checks after each that every gate is off.
pub fn off_for(board: &mut Board, periods: u64) -> Result<()> {
    for _ in 0..periods {
        board.run_periods(1)?;
        ensure!(!board.gates().any_on(), "a gate is on after {:.3} s", board.time());
        while board.next_period().is_some() {}
    }
    Ok(())
}
