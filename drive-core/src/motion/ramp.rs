//! The ramp of the speed reference.
//!
//! The reference changes by at most `most` in a step, and this change by at most `jerk`. Braking from a change `a`, by `jerk` in
//! every step, the reference goes on by `a + (a - jerk) + (a - 2 jerk) + ...` down to the last positive one, with this step
//! counted. Solved for a way `e` that is left,
//!
//! ```text
//! n = floor((sqrt(1 + 8 e/jerk) - 1)/2)        steps of braking
//! a = (e + jerk n (n + 1)/2)/(n + 1)
//! ```
//!
//! is the largest change from which the reference ends at the goal and not beyond it. A goal that has come nearer than the way
//! of braking is passed by the rest of that way.

use crate::math::{limited, within};

/// Coefficients of a ramp.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Its change in the last step.
    pub change: f32,
}

impl Ramp {
    /// A ramp of at most `most` in a step, which takes `rise` steps to come up to it; straight below half a step.
    pub fn new(most: f32, rise: f32) -> Self {
        // From one direction into the other in a single step.
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

    /// Largest change, with its sign, from which the reference can still end `left` further on.
    fn largest(&self, left: f32) -> f32 {
        let way = left.abs();
        let steps = 0.5 * (fpu_sqrt::sqrtf(1.0 + self.eight_per_jerk * way) - 1.0);
        let n = steps as i32 as f32;
        let change = (way + 0.5 * self.jerk * n * (n + 1.0)) / (n + 1.0);
        if left < 0.0 { -change } else { change }
    }
}

impl RampState {
    /// Moves the reference on by `more` in the same step.
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
        /// Whatever goals come, each at any moment: change and its change stay within their limits, and the reference ends at
        /// the goal. It passes one only where it was already on its way past it when the goal came.
        #[test]
        fn goals_are_met_within_the_limits_and_not_passed(
            goals in prop::collection::vec((-24.0_f32..24.0, 1_u32..400), 1..12),
            most in 0.01_f32..0.2,
            rise in 0.0_f32..300.0,
        ) {
            let ramp = Ramp::new(most, rise);
            let mut state = RampState::default();
            // Some thousand roundings of numbers up to 24.
            let tiny = 1e-3;
            let last = goals.len() - 1;
            for (n, (goal, steps)) in goals.into_iter().enumerate() {
                // The way that it goes on whatever it does.
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

    /// The change rises in `rise` steps, stays, and falls in as many: the way takes `rise` steps more than straight.
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
