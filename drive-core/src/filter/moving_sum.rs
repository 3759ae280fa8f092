//! Exact moving sums in integer arithmetic; a running sum of floats would drift.
//!
//! Own code: a ring buffer of a crate keeps its own index, while several signals share one index and one
//! loop here, and the length (up to `LENGTH`) is chosen at run time by the caller.

/// Moving sums of `SIGNALS` signals over up to `LENGTH` samples.
#[derive(Clone, Copy, Debug)]
pub struct MovingSum<const SIGNALS: usize, const LENGTH: usize> {
    ring: [[i32; SIGNALS]; LENGTH],
    sum: [i32; SIGNALS],
}

impl<const SIGNALS: usize, const LENGTH: usize> Default for MovingSum<SIGNALS, LENGTH> {
    fn default() -> Self {
        Self { ring: [[0; SIGNALS]; LENGTH], sum: [0; SIGNALS] }
    }
}

impl<const SIGNALS: usize, const LENGTH: usize> MovingSum<SIGNALS, LENGTH> {
    /// Stores the newest values at `index` of the ring and returns the sums. An `index` that runs from 0
    /// to n - 1 cyclically gives the sums over the last n samples.
    pub fn step(&mut self, index: usize, new: [i32; SIGNALS]) -> [i32; SIGNALS] {
        let slot = &mut self.ring[if index < LENGTH { index } else { 0 }];
        for ((sum, old), new) in self.sum.iter_mut().zip(slot.iter()).zip(new) {
            // Wrapping sums are exact as long as the true sum fits, as callers ensure.
            *sum = sum.wrapping_add(new).wrapping_sub(*old);
        }
        *slot = new;
        self.sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_that_of_the_last_samples() {
        let mut sums = MovingSum::<1, 8>::default();
        // This is the sum of the last two samples.
        let last = [1, 2, 3].iter().zip([0, 1, 0]).map(|(x, index)| sums.step(index, [*x])[0]);
        assert!(last.eq([1, 3, 5]));
    }
}
