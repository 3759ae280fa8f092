//! The names that most experiments use.

pub use sim_bench::prelude::*;

pub use crate::recomputed::{beside, printed};
pub use crate::source::named;
