//! The options that all simulating commands share.

use std::path::PathBuf;

use clap::Args;
use sim_bench::prelude::*;

/// The options that describe a simulation.
#[derive(Args, Clone, Default)]
pub struct Input {
    /// Motor, with inverter and sensors that suit it: a name from `motors`, a file that ends in .toml, or a passport
    /// that ends in .json
    #[arg(long, value_name = "NAME")]
    pub motor: Option<String>,
    /// Configuration file, TOML
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Model of the motor: a, or a saturation model from which saliency emerges; the same as --set plant=NAME
    #[arg(long, value_name = "NAME")]
    pub plant: Option<String>,
    /// Sets one key, after the configuration file; can be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub assignments: Vec<String>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Simulated time, s; the same as --set seconds=S
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// No progress bars: nothing but errors and the result
    #[arg(long, short)]
    pub quiet: bool,
}

/// Default folder of the pages.
pub const OUT: &str = "out";

impl Input {
    /// Returns the configuration that these options describe.
    ///
    /// # Errors
    /// As [`Config::load`] and [`Config::set`].
    pub fn config(&self) -> Result<Config, Error> {
        let mut config =
            Config::load(self.motor.as_deref(), self.config.as_deref(), &self.assignments)?;
        if let Some(plant) = &self.plant {
            config.set("plant", plant)?;
        }
        if let Some(seconds) = self.seconds {
            config.set("seconds", seconds)?;
        }
        Ok(config)
    }

    /// Returns progress bars, unless they are switched off.
    pub fn progress(&self) -> Progress {
        if self.quiet { Progress::hidden() } else { Progress::default() }
    }

    /// Returns the command line that repeats `cargo sim WHAT` with this configuration.
    pub fn command(&self, what: &str, config: &Config) -> String {
        let mut command = format!("cargo sim {what} --seed {}", self.seed);
        let mut base = Config::default();
        if let Some(name) = &self.motor
            && let Ok(config) = Config::of_motor(Some(name))
        {
            command.push_str(&format!(" --motor {name}"));
            base = config;
        }
        for change in config.changes_from(&base) {
            command.push_str(&format!(" --set {change}"));
        }
        command
    }
}
