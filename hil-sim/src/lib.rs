//! The drive connected to a simulated motor: experiments, reports and the command line.
//!
//! The test rig below the experiments is the crate `sim-bench`, the laboratory is `sim-lab`; both are re-exported here.

pub mod board;
pub mod cli;
mod coefficients;
pub mod console;
pub mod experiments;
pub mod first_light;
pub mod input;
pub mod journal;
pub mod passport;
mod prelude;
mod random;
pub mod report;
mod repository;
pub mod sessions;

pub use sim_bench::{
    Config, Error, Outcome, bounded, columns, config, error, outcome, plant, progress, rig, stats,
};
pub use sim_lab::identification;
