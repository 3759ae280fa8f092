//! The drive connected to a simulated motor: experiments, reports and the command line.

pub mod board;
pub mod cli;
pub mod columns;
pub mod config;
pub mod console;
pub mod error;
pub mod experiments;
pub mod identification;
pub mod input;
pub mod outcome;
pub mod progress;
pub mod report;
pub mod rig;
pub mod shards;
pub mod stats;

pub use config::Config;
pub use error::Error;
pub use motor_plant as plant;
pub use outcome::Outcome;
