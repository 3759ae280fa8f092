//! The input of an experiment, and its jobs on all cores.

use crate::config::Config;
use crate::error::Error;
use crate::progress::Progress;
use rayon::prelude::*;
use std::path::Path;

/// Input of an experiment.
pub struct Context<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Simulated time, s; unset: the experiment's own time.
    pub seconds: Option<f64>,
    /// The progress bars.
    pub progress: Progress,
    /// File for an experiment that takes one.
    pub file: Option<&'a Path>,
}

impl<'a> Context<'a> {
    /// Makes an input without a file, for as long as the configuration says.
    pub fn new(config: &'a Config, seed: u64, progress: Progress) -> Self {
        Self { config, seed, seconds: config.extent.seconds, progress, file: None }
    }

    /// Runs `run` with number and value of every job on all cores, with a progress bar.
    ///
    /// # Errors
    /// The error of a failed job.
    pub fn in_parallel<J: Sync, T: Send>(
        &self,
        label: &str,
        jobs: &[J],
        run: impl Fn(u64, &J) -> Result<T, Error> + Sync,
    ) -> Result<Vec<T>, Error> {
        let bar = self.progress.bar(label, jobs.len() as u64);
        let one = |(number, job): (usize, &J)| {
            let result = run(number as u64, job);
            bar.inc(1);
            result
        };
        jobs.par_iter().enumerate().map(one).collect()
    }
}
