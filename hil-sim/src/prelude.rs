//! The names that most experiments and commands use.

pub use std::path::{Path, PathBuf};

pub use rand::{Rng, RngExt};
pub use sim_bench::prelude::*;

pub use crate::random::{seeded, sign};
