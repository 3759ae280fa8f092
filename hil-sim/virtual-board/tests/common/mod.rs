//! Helpers of the tests.

pub mod program;
pub mod script;

use anyhow::{Result, bail};
use drive_core::State;
use hil_sim::Config;
use virtual_board::{Board, Image, Options, Pair};

/// Longest from a reset to the greeting, and from an order to its answer, periods.
const LONGEST: u64 = 30_000;

/// A board with the image that was built last, beside its shadow, started.
pub fn pair(config: &Config, seed: u64) -> Result<Pair> {
    Pair::new(Image::built()?, Options::new(config, seed))
}

/// The same, regulating torque without a sensor.
pub fn regulating(seed: u64) -> Result<Pair> {
    let mut pair = pair(&Config::default(), seed)?;
    pair.order("start torque")?;
    pair.until_state(State::Torque)?;
    Ok(pair)
}

/// Goes on until the console says a line with this text; all that it has said.
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
