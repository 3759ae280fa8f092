//! The names that most experiments use.

pub use sim_bench::prelude::*;

pub use crate::source::{beside, named, printed};
