//! Running statistics.

/// Mean, rms and largest magnitude of a signal.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stats {
    count: u64,
    sum: f64,
    squares: f64,
    largest: f64,
}

impl Stats {
    /// Of all these values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut stats = Self::default();
        values.into_iter().for_each(|v| stats.push(v));
        stats
    }

    /// Takes one value in.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.squares += value * value;
        self.largest = self.largest.max(value.abs());
    }

    /// Mean; not a number when there are no values.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_few_values() {
        let s = Stats::of([3.0, -4.0, 1.0]);
        assert_eq!(s.mean(), 0.0);
        assert_eq!(s.largest(), 4.0);
        assert!((s.rms() - (26.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((s.deviation() - s.rms()).abs() < 1e-12);
    }
}
