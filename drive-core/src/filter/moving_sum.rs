//! Sums over the last samples, exact for ever.
//!
//! The sums are integers: they hold their value, where a running sum of floats would drift.

/// The sums of the last samples of `SIGNALS` signals, at most `LENGTH` of them.
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
    /// Takes the newest values in at place `index` of the ring; the sums of as many samples as the
    /// index has values before it starts again.
    pub fn step(&mut self, index: usize, new: [i32; SIGNALS]) -> [i32; SIGNALS] {
        let slot = &mut self.ring[if index < LENGTH { index } else { 0 }];
        for ((sum, old), new) in self.sum.iter_mut().zip(slot.iter()).zip(new) {
            // Wrapping sums are exact as long as the true sum fits, which it does.
            *sum = sum.wrapping_add(new).wrapping_sub(*old);
        }
        *slot = new;
        self.sum
    }
}
