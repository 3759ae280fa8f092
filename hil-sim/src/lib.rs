//! The motor, inverter and sensors that the drive is tested against, and the experiments.

pub mod board;
pub mod cli;
pub mod config;
pub mod error;
pub mod experiments;
pub mod identification;
pub mod learn;
pub mod outcome;
pub mod perturbation;
pub mod plant;
pub mod progress;
pub mod report;
pub mod rig;
pub mod stats;
pub mod tracking;

pub use config::Config;
pub use error::Error;
pub use outcome::Outcome;
