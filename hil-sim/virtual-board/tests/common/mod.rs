//! Functions for the tests.

pub mod program;
pub mod script;

use anyhow::{Result, bail};
use hil_sim::Config;
use virtual_board::{Board, Image, Options, Pair};

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
    let mut said = String::new();
    for _ in 0..LONGEST / 60 {
        board.run_periods(60)?;
        while board.next_period().is_some() {}
        said += &board.take_console();
        if said.contains(text) && said.ends_with('\n') {
            return Ok(said);
        }
    }
    bail!("no {text:?} in {said:?}")
}
