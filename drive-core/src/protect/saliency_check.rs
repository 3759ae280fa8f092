//! Saliency check: verifies at every start, before torque, that the motor has the saliency that the
//! injection needs.
//!
//! Stator current masks the flux-fixed saliency, since it causes a saliency of its own, along the flux when
//! there is no torque. The current is therefore removed once the flux is built up. While the flux decays
//! with the rotor time constant, the carrier, turned to 60° from it, shows the saliency of the flux alone.
//! (60° instead of 45°: the flux lies along phase a, and at multiples of 30° the voltage drop of the power
//! stage has the direction of the carrier. At 45° a drop of 1.6 V per phase looks like a saliency of
//! 0.0135.) Then the flux is built up again.

use crate::io::periods;
use crate::math::angle::UnitVector;
use crate::math::frames::SQRT_3;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaliencyCheck {
    /// Settling time of current and averages, control periods.
    settle: u32,
    /// Averaging time, control periods.
    average: u32,
    /// Time to build the flux up again, control periods.
    restore: u32,
    /// Threshold of the mean saliency, with its sign.
    least: f32,
    /// 1 / expected mean saliency.
    per_expected: f32,
    /// 1 / number of averaged samples.
    per_average: f32,
}

/// State of the check.
#[derive(Clone, Copy, Debug, Default)]
pub struct SaliencyCheckState {
    sum: f32,
    /// Measured saliency of the motor relative to the setting; result of the last check.
    pub share: f32,
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

/// Settling time, s; with [`AVERAGE_S`] below the rotor time constant.
const SETTLE_S: f32 = 0.020;
/// Averaging time, s.
const AVERAGE_S: f32 = 0.120;
/// Mean saliency over the decaying flux at 60°, relative to the saliency at nominal flux.
const SEEN_SHARE: f32 = 0.535;
/// Threshold relative to the saliency of the settings. The mean is 0.54 with the full saliency, 0.27 with
/// half of it, 0.05 with a tenth and 0 without, each ±0.024 rms by noise of 5 mA. The threshold lies midway
/// between a tenth and half, more than four standard deviations from both. (A longer average would contain
/// less flux.)
const LEAST_SHARE: f32 = 0.161;
/// Time to build the flux up again, in rotor time constants; it returns to within 5 %.
const RESTORE_T: f32 = 2.4;

impl SaliencyCheck {
    /// Check for a flux-fixed saliency (with its sign) and the rotor time constant `tau_r`, s.
    pub fn new(flux_saliency: f32, tau_r: f32) -> Self {
        let average = periods(AVERAGE_S);
        Self {
            settle: periods(SETTLE_S),
            average,
            restore: periods(RESTORE_T * tau_r),
            least: LEAST_SHARE * flux_saliency,
            per_expected: 1.0 / (SEEN_SHARE * flux_saliency),
            per_average: 1.0 / average as f32,
        }
    }

    /// Flux-fixed saliency at nominal flux measured by a finished check.
    pub fn seen(&self, state: &SaliencyCheckState) -> f32 {
        state.sum / (SEEN_SHARE * self.average as f32)
    }

    /// Injection axis in the flux frame during [`SaliencyCheckAction::Look`]: 60° ahead of the flux.
    pub const LOOK_AXIS: UnitVector = UnitVector { cos: 0.5, sin: 0.5 * SQRT_3 };

    /// Processes control period `elapsed` of the check with its saliency `q`.
    pub fn step(
        &self,
        state: &mut SaliencyCheckState,
        elapsed: u32,
        q: f32,
    ) -> SaliencyCheckAction {
        let looked = self.settle + self.average;
        if elapsed < self.settle {
            state.sum = 0.0;
            SaliencyCheckAction::Look
        } else if elapsed < looked {
            state.sum += q;
            SaliencyCheckAction::Look
        } else if elapsed < looked + self.restore {
            let mean = state.sum * self.per_average;
            // The mean must exceed the threshold with the same sign; NaN fails.
            let enough = if self.least < 0.0 { mean <= self.least } else { mean >= self.least };
            state.share = mean * self.per_expected;
            if enough { SaliencyCheckAction::Restore } else { SaliencyCheckAction::Failed }
        } else {
            SaliencyCheckAction::Passed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Periods in each phase, the last phase, and the state, with this saliency seen throughout.
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
            let check = SaliencyCheck::new(expected, 0.186);
            // The mean over the decaying flux is 0.535 of the saliency; 0.3 of what is expected is enough.
            for (share, passes) in
                [(1.0, true), (2.0, true), (0.31, true), (0.29, false), (-1.0, false)]
            {
                let (count, end, state) = run(&check, 0.535 * share * expected);
                let expected_end =
                    if passes { SaliencyCheckAction::Passed } else { SaliencyCheckAction::Failed };
                assert_eq!(end, expected_end, "{expected} {share}");
                assert!((state.share - share).abs() < 1e-3, "{}", state.share);
                assert!((check.seen(&state) / (share * expected) - 1.0).abs() < 1e-3);
                // 20 ms to settle, 120 ms to look, 2.4 time constants to restore.
                assert_eq!(count[0], 840);
                assert!(!passes || count[1].abs_diff(2678) <= 1, "{count:?}");
            }
            assert_eq!(run(&check, f32::NAN).1, SaliencyCheckAction::Failed);
        }
    }

    #[test]
    fn samples_before_settling_do_not_count() {
        let check = SaliencyCheck::new(-0.035, 0.186);
        let mut state = SaliencyCheckState::default();
        for elapsed in 0..841 {
            let q = if elapsed < 120 || elapsed == 840 { 9.0 } else { -0.5 * 0.035 };
            check.step(&mut state, elapsed, q);
        }
        assert!((state.share - 0.5 / 0.535).abs() < 1e-3, "{}", state.share);
    }
}
