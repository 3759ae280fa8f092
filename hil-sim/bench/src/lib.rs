//! The test rig of the simulator: the drive on its simulated motor, the configuration, and the form of experiments and
//! their results. The experiments themselves are in `sim-lab` and `hil-sim`.
#![deny(clippy::use_debug)]

pub mod bode;
pub mod bounded;
pub mod columns;
pub mod config;
pub mod context;
pub mod error;
pub mod experiment;
pub mod learning;
pub mod outcome;
pub mod prelude;
pub mod progress;
pub mod rig;
pub mod statistics;
pub mod stats;
pub mod steady;

pub use config::Config;
pub use error::Error;
pub use experiment::{Context, Experiment};
pub use motor_plant as plant;
pub use outcome::Outcome;
