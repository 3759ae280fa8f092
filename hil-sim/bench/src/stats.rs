//! Running statistics.

pub mod exact;

use drive_settings::tuning::bisected;
use serde::{Deserialize, Serialize};

/// Mean, rms and largest magnitude of a signal.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Stats {
    count: u64,
    #[serde(with = "exact")]
    sum: f64,
    #[serde(with = "exact")]
    squares: f64,
    #[serde(with = "exact")]
    largest: f64,
}

impl Stats {
    /// Computes the statistics of these values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut stats = Self::default();
        values.into_iter().for_each(|v| stats.push(v));
        stats
    }

    /// Adds one value.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.squares += value * value;
        self.largest = self.largest.max(value.abs());
    }

    /// Adds the values of other statistics.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
        self.largest = self.largest.max(other.largest);
    }

    /// Number of values.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Mean; not a number if there are no values.
    pub fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }

    /// Root of the mean square.
    pub fn rms(&self) -> f64 {
        (self.squares / self.count as f64).sqrt()
    }

    /// Root of the mean square about the mean.
    pub fn deviation(&self) -> f64 {
        (self.squares / self.count as f64 - self.mean().powi(2)).max(0.0).sqrt()
    }

    /// Largest magnitude.
    pub fn largest(&self) -> f64 {
        self.largest
    }
}

/// Returns the values in ascending order.
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The smallest value that this share of the sorted values does not exceed; not a number if there are no values.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

/// A straight line `y = slope x + intercept`.
#[derive(Clone, Copy, Debug)]
pub struct StraightLine {
    /// Slope, unit of y per unit of x.
    pub slope: f64,
    /// Value at x = 0.
    pub intercept: f64,
}

impl StraightLine {
    /// Fits a line by least squares of y on x.
    pub fn through(points: &[(f64, f64)]) -> Self {
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| Stats::of(points.iter().map(f)).mean();
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2));
        Self { slope, intercept: y - slope * x }
    }

    /// Returns the value at `x`.
    pub fn at(self, x: f64) -> f64 {
        self.slope * x + self.intercept
    }
}

/// Upper bound of a rate per trial at 95 % confidence after `events` in `trials`: the rate at which as few events would
/// occur in 5 % of all cases. Without events it is 3 / trials.
pub fn upper_bound_95(events: u64, trials: u64) -> f64 {
    let at_most = |mean: f64| {
        let mut term = (-mean).exp();
        let mut sum = term;
        for k in 1..=events {
            term *= mean / k as f64;
            sum += term;
        }
        sum
    };
    let most = 10.0 + 3.0 * events as f64;
    bisected((0.0, most), 60, &|mean| at_most(mean) > 0.05).1 / trials as f64
}
