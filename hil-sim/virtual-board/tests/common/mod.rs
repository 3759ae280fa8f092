//! Helpers of the tests.

pub mod program;
pub mod script;

use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use virtual_board::{Image, Options, Pair};

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
