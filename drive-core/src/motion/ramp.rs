//! Ramp of the speed reference with limited jerk.
//!
//! The reference changes by at most `most` in a step, and this change by at most `jerk`. When it brakes from a change `a`, by
//! `jerk` in every step, the reference continues by `a + (a - jerk) + (a - 2 jerk) + ...` down to the last positive term,
//! including the present step. Solved for a remaining distance `e`,
//!
//! ```text
//! n = floor((sqrt(1 + 8 e/jerk) - 1)/2)        steps of braking
//! a = (e + jerk n (n + 1)/2)/(n + 1)
//! ```
//!
//! is the largest change from which the reference ends at the goal and not beyond it. If a goal has come nearer than the
//! braking distance, the reference overshoots it by the rest of that distance.

use crate::math::{limited, within};

/// Coefficients of a ramp.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Ramp {
    /// Largest change of the reference in a step.
    most: f32,
    /// Largest change of that change in a step.
    jerk: f32,
    eight_per_jerk: f32,
}

/// State of a ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RampState {
    /// The reference.
    pub reference: f32,
    /// Change of the reference in the last step.
    pub change: f32,
}

impl Ramp {
    /// Creates a ramp of at most `most` in a step, which takes `rise` steps to reach it; below half a step the jerk is not limited.
    pub fn new(most: f32, rise: f32) -> Self {
        // Without a limit, the change may reverse in a single step.
        let jerk = if rise > 0.5 { most / rise } else { 2.0 * most };
        Self { most, jerk, eight_per_jerk: 8.0 / jerk }
    }

    /// Moves the reference a step towards `goal`, and returns its change.
    pub fn step(&self, state: &mut RampState, goal: f32) -> f32 {
        let wanted = limited(self.largest(goal - state.reference), self.most);
        let change = within(wanted, (state.change - self.jerk, state.change + self.jerk));
        state.change = change;
        state.reference += change;
        change
    }

    /// Returns the largest change, with its sign, from which the reference can still end `left` further on.
    fn largest(&self, left: f32) -> f32 {
        let way = left.abs();
        let steps = 0.5 * (fpu_sqrt::sqrtf(1.0 + self.eight_per_jerk * way) - 1.0);
        let n = steps as i32 as f32;
        let change = (way + 0.5 * self.jerk * n * (n + 1.0)) / (n + 1.0);
        if left < 0.0 { -change } else { change }
    }
}

impl RampState {
    /// Moves the reference by `more` in the same step.
    pub fn shift(&mut self, more: f32) {
        self.reference += more;
        self.change += more;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// For any goals at any times, the change and its change stay within their limits, and the reference ends at the
        /// goal. The reference overshoots a goal only if it was already too close to brake when the goal came.
        #[test]
        fn goals_are_met_within_the_limits_and_not_passed(
            goals in prop::collection::vec((-24.0_f32..24.0, 1_u32..400), 1..12),
            most in 0.01_f32..0.2,
            rise in 0.0_f32..300.0,
        ) {
            let ramp = Ramp::new(most, rise);
            let mut state = RampState::default();
            // The tolerance covers some thousand roundings of numbers up to 24.
            let tiny = 1e-3;
            let last = goals.len() - 1;
            for (n, (goal, steps)) in goals.into_iter().enumerate() {
                // This is the braking distance.
                let a = state.change.abs();
                let way: f32 = (1..=(a / ramp.jerk) as u32).map(|k| a - k as f32 * ramp.jerk).sum();
                let end = state.reference + way.copysign(state.change);
                let (low, high) = (f32::min(state.reference, goal), f32::max(state.reference, goal));
                let (low, high) = (f32::min(low, end) - tiny, f32::max(high, end) + tiny);
                let steps = if n == last { 20_000 } else { steps };
                for _ in 0..steps {
                    let before = state;
                    ramp.step(&mut state, goal);
                    prop_assert!(state.change.abs() <= most * 1.0001);
                    prop_assert!((state.change - before.change).abs() <= ramp.jerk * 1.0001);
                    prop_assert!((low..=high).contains(&state.reference), "{state:?} {goal}");
                }
                if n == last {
                    prop_assert!((state.reference - goal).abs() < 1e-5, "{state:?} {goal}");
                }
            }
        }
    }

    /// The change rises in `rise` steps, stays constant, and falls in `rise` steps, so the ramp takes `rise` steps more than a
    /// straight one.
    #[test]
    fn it_takes_as_long_as_the_jerk_makes_it() {
        let steps = |rise: f32| {
            let (ramp, mut state) = (Ramp::new(0.05, rise), RampState::default());
            (0..10_000)
                .take_while(|_| {
                    ramp.step(&mut state, 5.0);
                    (state.reference - 5.0).abs() > 1e-4
                })
                .count()
        };
        for (rise, expected) in [(0.0, 100.0), (50.0, 150.0), (20.0, 120.0)] {
            assert!((steps(rise) as f64 - expected).abs() < 3.0, "{rise}: {}", steps(rise));
        }
    }
}
