//! Saliency check: verifies at every start, before torque, that the motor has the saliency that the
//! injection needs.
//!
//! Stator current masks the flux-fixed saliency, since it causes its own saliency, which lies along the
//! flux when there is no torque. The current is therefore removed once the flux is built up. While the flux
//! decays with the rotor time constant, the injection, turned by 60° from the flux, shows the saliency of
//! the flux alone. (The angle is 60° instead of 45°, because the flux lies along phase a, and at multiples
//! of 30° the inverter voltage error has the direction of the injection. At 45° an error of 1.6 V per phase
//! looks like a saliency of 0.0135.) Then the flux is built up again.

use crate::learned::Learned;
use crate::{SQRT_3, UnitVector};

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SaliencyCheck {
    /// Settling time of current and averages, control periods.
    pub settle: u32,
    /// Averaging time, control periods.
    pub average: u32,
    /// Time to build the flux up again, control periods.
    pub restore: u32,
    /// Threshold of the mean saliency, with its sign.
    pub least: f32,
    /// Mean saliency over the decaying flux at 60°, relative to the saliency at nominal flux.
    pub seen_share: f32,
    /// 1 / number of averaged samples.
    pub per_average: f32,
}

/// State of the check.
#[derive(Clone, Copy, Debug, Default)]
pub struct SaliencyCheckState {
    sum: f32,
}

/// Action of the drive in a control period of the check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaliencyCheckAction {
    /// Zero current, injection along [`SaliencyCheck::LOOK_AXIS`].
    Look,
    /// Magnetising current, injection along its normal axis.
    Restore,
    /// The check has passed; continue the start.
    Passed,
    /// The saliency is too small.
    Failed,
}

/// Least flux-fixed saliency relative to the sensitivity, which is twice the effective saliency, at which a learned motor is
/// checked.
const LEAST_SEEN: f32 = 0.375;
impl SaliencyCheck {
    /// Threshold relative to the mean for the saliency of the settings: midway between a tenth and half of it. With the
    /// 3.5 % of the dissertation's motor, both are more than four standard deviations away, with noise of 5 mA.
    pub const LEAST_SHARE: f32 = 0.3;

    /// Returns the check for a learned motor, which expects the saliency that the check of the self-commissioning has
    /// measured. None if that saliency is less than 3/8 of the sensitivity or has the other sign: a saliency that falls
    /// with a power of the flux vanishes before it is averaged, and a saliency of the current is not visible without
    /// current. Then only the verification of the lock protects the start.
    pub fn of_learned(&self, learned: &Learned) -> Option<Self> {
        let (seen, slope) = (learned.flux_saliency, learned.slope_at_rest);
        let suits = seen * slope > 0.0 && seen.abs() >= LEAST_SEEN * slope.abs();
        suits.then_some(Self { least: Self::LEAST_SHARE * self.seen_share * seen, ..*self })
    }

    /// Returns the mean saliency that a finished check has measured.
    pub fn mean(&self, state: &SaliencyCheckState) -> f32 {
        state.sum * self.per_average
    }

    /// Returns the flux-fixed saliency at nominal flux per mean saliency.
    pub fn per_mean(&self) -> f32 {
        1.0 / self.seen_share
    }

    /// Injection axis in the flux frame during `SaliencyCheckAction::Look`: 60° ahead of the flux.
    pub const LOOK_AXIS: UnitVector = UnitVector { cos: 0.5, sin: 0.5 * SQRT_3 };

    /// Processes control period `elapsed` of the check with its saliency `q`.
    pub fn step(
        &self,
        state: &mut SaliencyCheckState,
        elapsed: u32,
        q: f32,
    ) -> SaliencyCheckAction {
        let looked = self.settle + self.average;
        if elapsed < looked {
            state.sum = if elapsed < self.settle { 0.0 } else { state.sum + q };
            SaliencyCheckAction::Look
        } else if elapsed < looked + self.restore {
            let mean = self.mean(state);
            // The mean must exceed the threshold with the same sign; NaN fails.
            let enough = if self.least < 0.0 { mean <= self.least } else { mean >= self.least };
            if enough { SaliencyCheckAction::Restore } else { SaliencyCheckAction::Failed }
        } else {
            SaliencyCheckAction::Passed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::design::saliency_check::design;

    /// Runs the check with a constant saliency. Returns the periods in each phase, the last phase, and the state.
    fn run(check: &SaliencyCheck, q: f32) -> ([usize; 2], SaliencyCheckAction, SaliencyCheckState) {
        let (mut state, mut count) = (SaliencyCheckState::default(), [0; 2]);
        for elapsed in 0..100_000 {
            match check.step(&mut state, elapsed, q) {
                SaliencyCheckAction::Look => count[0] += 1,
                SaliencyCheckAction::Restore => count[1] += 1,
                end => return (count, end, state),
            }
        }
        panic!("it does not end");
    }

    #[test]
    fn enough_saliency_of_the_right_sign_passes() {
        for expected in [-0.035, 0.05] {
            let check = design(expected, 0.186);
            // The mean over the decaying flux is 0.5402 of the saliency; 0.3 of the expected value is enough.
            for (share, passes) in
                [(1.0, true), (2.0, true), (0.31, true), (0.29, false), (-1.0, false)]
            {
                let (count, end, state) = run(&check, 0.5402 * share * expected);
                let expected_end =
                    if passes { SaliencyCheckAction::Passed } else { SaliencyCheckAction::Failed };
                assert_eq!(end, expected_end, "{expected} {share}");
                let seen = check.mean(&state) * check.per_mean();
                assert!((seen / (share * expected) - 1.0).abs() < 1e-3, "{seen}");
                // The times are 20 ms to settle, 0.645 time constants to look, and 2.4 time constants to restore.
                assert_eq!(count[0], 840);
                assert!(!passes || count[1].abs_diff(2678) <= 1, "{count:?}");
            }
            assert_eq!(run(&check, f32::NAN).1, SaliencyCheckAction::Failed);
        }
    }

    /// The baseline of the lock monitor approaches its value with current with a time constant of 0.05 s. A rotor of 24 ms, of a motor
    /// for 250 Hz, would be magnetised after only 58 ms.
    #[test]
    fn a_fast_rotor_waits_for_the_baseline() {
        let check = design(-0.035, 0.024);
        let (count, end, _) = run(&check, -0.035);
        assert_eq!((end, count[1]), (SaliencyCheckAction::Passed, 1500));
    }

    #[test]
    fn samples_before_settling_do_not_count() {
        let check = design(-0.035, 0.186);
        let mut state = SaliencyCheckState::default();
        for elapsed in 0..841 {
            let q = if elapsed < 120 || elapsed == 840 { 9.0 } else { -0.5 * 0.035 };
            check.step(&mut state, elapsed, q);
        }
        assert!((check.mean(&state) + 0.5 * 0.035).abs() < 1e-5, "{}", check.mean(&state));
    }
}
