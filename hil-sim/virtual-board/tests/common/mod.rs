//! What the tests share.

use anyhow::Result;
use hil_sim::Config;
use virtual_board::{Image, Options, Pair};

/// A board with the image that was built last, beside its shadow, started.
pub fn pair(config: &Config, seed: u64) -> Result<Pair> {
    Pair::new(Image::built()?, Options::new(config, seed))
}
