//! Does the motor have the saliency that the injection lives on? Asked at every start, before there is
//! torque.
//!
//! With current in the stator the answer is hidden: the current makes a saliency of its own, along the
//! flux when there is no torque. So the current is taken away when the flux stands, and while the flux
//! decays (with the rotor time constant) the carrier, turned to 60° from it, sees the saliency of the
//! flux alone. (60° and not 45°: the flux lies along phase a, and at multiples of 30° the voltage that
//! the power stage drops has the direction of the carrier. At 45° a drop of 1.6 V a phase looks like a
//! saliency of 0.0135.) Then the flux is built up again.

use crate::io::periods;
use crate::math::angle::UnitVector;
use crate::math::frames::SQRT_3;

/// Coefficients of the check.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaliencyCheck {
    /// Control periods until current and averages have settled.
    settle: u32,
    /// Control periods to average.
    average: u32,
    /// Control periods to build the flux up again.
    restore: u32,
    /// Least mean saliency, signed as it must be.
    least: f32,
    /// 1 / mean saliency of a motor that has what is expected.
    per_expected: f32,
    /// 1 / samples that are averaged.
    per_average: f32,
}

/// State of the check.
#[derive(Clone, Copy, Debug, Default)]
pub struct SaliencyCheckState {
    sum: f32,
    /// Saliency of the motor as a share of the expected one, as the last check saw it.
    pub share: f32,
}

/// What the drive is to do in this period of the check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// No current, the injection turned to 60° from the flux.
    Look,
    /// The magnetising current again, the injection where it belongs.
    Restore,
    /// Go on.
    Passed,
    /// There is too little saliency.
    Failed,
}

/// Time to settle and to average, s; together below the rotor time constant.
const SETTLE_S: f32 = 0.020;
const AVERAGE_S: f32 = 0.120;
/// The mean over the decaying flux, seen at 60°, as a share of the saliency at nominal flux.
const SEEN_SHARE: f32 = 0.535;
/// Least share of the expected saliency. The mean is 0.54 with all of it, 0.27 with half of it, 0.05
/// with a tenth and 0 with none, each ±0.024 rms by noise of 5 mA: the limit lies in the middle between
/// a tenth and half, more than four deviations from both. (A longer mean would be of less flux.)
const LEAST_SHARE: f32 = 0.161;
/// Time to build the flux up again, in rotor time constants: it comes back to 5 %.
const RESTORE_T: f32 = 2.4;

impl SaliencyCheck {
    /// For the saliency fixed to the flux and the rotor time constant, s.
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

    /// The saliency fixed to the flux, at its nominal value, that a finished check has seen.
    pub fn seen(&self, state: &SaliencyCheckState) -> f32 {
        state.sum / (SEEN_SHARE * self.average as f32)
    }

    /// The injection axis seen from the flux while looking: a sixth of a turn ahead.
    pub const LOOK_AXIS: UnitVector = UnitVector { cos: 0.5, sin: 0.5 * SQRT_3 };

    /// Period `elapsed` of the check, with the saliency seen in it.
    pub fn step(&self, state: &mut SaliencyCheckState, elapsed: u32, q: f32) -> Phase {
        let looked = self.settle + self.average;
        if elapsed < self.settle {
            state.sum = 0.0;
            Phase::Look
        } else if elapsed < looked {
            state.sum += q;
            Phase::Look
        } else if elapsed < looked + self.restore {
            let mean = state.sum * self.per_average;
            // Beyond the least, on its side of zero. Not-a-number is not.
            let enough = if self.least < 0.0 { mean <= self.least } else { mean >= self.least };
            state.share = mean * self.per_expected;
            if enough { Phase::Restore } else { Phase::Failed }
        } else {
            Phase::Passed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Periods in each phase, the last phase, and the state, with this saliency seen throughout.
    fn run(check: &SaliencyCheck, q: f32) -> ([usize; 2], Phase, SaliencyCheckState) {
        let (mut state, mut count) = (SaliencyCheckState::default(), [0; 2]);
        for elapsed in 0..100_000 {
            match check.step(&mut state, elapsed, q) {
                Phase::Look => count[0] += 1,
                Phase::Restore => count[1] += 1,
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
                let expected_end = if passes { Phase::Passed } else { Phase::Failed };
                assert_eq!(end, expected_end, "{expected} {share}");
                assert!((state.share - share).abs() < 1e-3, "{}", state.share);
                assert!((check.seen(&state) / (share * expected) - 1.0).abs() < 1e-3);
                // 20 ms to settle, 120 ms to look, 2.4 time constants to restore.
                assert_eq!(count[0], 840);
                assert!(!passes || count[1].abs_diff(2678) <= 1, "{count:?}");
            }
            assert_eq!(run(&check, f32::NAN).1, Phase::Failed);
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
