//! The names that most experiments use.

pub use rand::{Rng, RngExt};
pub use sim_bench::prelude::*;

pub use crate::random::{seeded, sign};
