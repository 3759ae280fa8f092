//! Currents from three shunts below the low sides.
//!
//! A shunt carries the current of its phase only while the low side of that leg is on. The currents are sampled in the middle of
//! that time, at the top of the counter. If the low side of a leg is on for less than the [window](Shunts::new), the leg cannot be
//! read, and its current is computed as minus the sum of the others. The modulator leaves at most one leg unreadable
//! ([`Modulator::readable`](crate::current::modulation::Modulator::readable)). While all three legs can be read, the sum of the
//! currents must be zero.

use crate::{Line, PERIOD_S};

/// Time constant of the mean of the sum, samples.
const MEAN_SAMPLES: f32 = 16.0;

/// Coefficients of the third current and of the selection of the phases.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Shunts {
    /// Calibration of current c, A.
    pub current_c: Line,
    /// Largest duty at which a leg can be read.
    pub readable: f32,
    /// Largest mean of the sum of the three currents, A.
    pub largest_sum: f32,
}

/// State of the selection.
#[derive(Clone, Copy, Debug, Default)]
pub struct ShuntState {
    /// Duties of the period before the next sample and of the period after it.
    before: [f32; 3],
    after: [f32; 3],
    /// Mean of the sum of the currents while all three are read, A.
    sum: f32,
}

impl Shunts {
    /// Creates the coefficients. A leg can be read if its low side is on for at least `window_s`, s, before and after the sample:
    /// dead time, settling of the amplifier, and sampling.
    pub fn new(current_c: Line, window_s: f32, largest_sum: f32) -> Self {
        Self { current_c, readable: 1.0 - 2.0 * window_s / PERIOD_S, largest_sum }
    }

    /// Returns the currents of phases a and b, A, from three readings, A; a reading that cannot be used is replaced.
    pub fn choose(&self, state: &mut ShuntState, [a, b, c]: [f32; 3]) -> (f32, f32) {
        let hidden =
            |leg: usize| state.before[leg] > self.readable || state.after[leg] > self.readable;
        if hidden(0) {
            (-(b + c), b)
        } else if hidden(1) {
            (a, -(a + c))
        } else {
            if !hidden(2) {
                state.sum += (a + b + c - state.sum) * (1.0 / MEAN_SAMPLES);
            }
            (a, b)
        }
    }

    /// Whether the sum of the currents is zero within its limit; false for NaN.
    pub fn sums_to_zero(&self, state: &ShuntState) -> bool {
        state.sum.abs() <= self.largest_sum
    }
}

impl ShuntState {
    /// Records the output of a step, which takes effect with the period after the next sample.
    pub fn applied(&mut self, duties: [f32; 3]) {
        self.before = self.after;
        self.after = duties;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: Line = Line { gain: -0.01, offset: 20.0 };

    fn shunts() -> Shunts {
        Shunts::new(LINE, 5e-6, 0.5)
    }

    #[test]
    fn the_window_is_the_share_of_the_period_around_the_sample() {
        // The window is 10 us of 166.7 us, so 94 % can be read.
        assert!((shunts().readable - 0.94).abs() < 1e-6);
    }

    #[test]
    fn the_leg_that_cannot_be_read_is_the_sum_of_the_others() {
        let shunts = shunts();
        let true_currents = [3.0, -1.0, -2.0];
        for hidden in 0..3 {
            let mut read = true_currents;
            read[hidden] = 0.0;
            let (low, mut high) = ([0.0; 3], [0.5; 3]);
            high[hidden] = 0.99;
            for output in [[high, low], [low, high]] {
                let mut state = ShuntState::default();
                output.iter().for_each(|duties| state.applied(*duties));
                assert_eq!(shunts.choose(&mut state, read), (3.0, -1.0), "leg {hidden}");
                assert!(shunts.sums_to_zero(&state), "a hidden leg is not part of the sum");
            }
        }
    }

    #[test]
    fn a_gain_that_is_wrong_shows_in_the_sum_and_noise_does_not() {
        let (shunts, mut state) = (shunts(), ShuntState::default());
        for k in 0..200 {
            let noise = if k % 2 == 0 { 0.7 } else { -0.7 };
            shunts.choose(&mut state, [3.0 + noise, -1.0, -2.0]);
            assert!(shunts.sums_to_zero(&state));
        }
        for _ in 0..100 {
            shunts.choose(&mut state, [3.0 * 1.3, -1.0, -2.0]);
        }
        assert!(!shunts.sums_to_zero(&state));
        shunts.choose(&mut state, [f32::NAN, -1.0, -2.0]);
        assert!(!shunts.sums_to_zero(&state));
    }
}
