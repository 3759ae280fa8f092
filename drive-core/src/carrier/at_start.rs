//! Asymmetry of sensors and stator, measured at a start before there is fundamental current or flux.
//!
//! Under torque at zero stator frequency, an unknown asymmetry pulls the estimated angle onto the stator, and cannot be
//! distinguished from the saliency of the flux. Without flux and without d-axis current there is no other saliency, so an injection
//! along phase a, then 60° and 120° ahead of it, shows the [asymmetry](super::asymmetry) alone. (Along these axes the inverter
//! voltage errors also lie along the injected voltage.)
//!
//! ```text
//! q(0°) = constant + cos      q(60°), q(120°) = constant - cos/2 +- sin sqrt3/2
//! ```

use crate::carrier::Asymmetry;
use crate::{SQRT_3, UnitVector, periods};

/// Injection axes, as angles from phase a.
const AXES: [UnitVector; 3] = [
    UnitVector { cos: 1.0, sin: 0.0 },
    UnitVector { cos: 0.5, sin: 0.5 * SQRT_3 },
    UnitVector { cos: -0.5, sin: 0.5 * SQRT_3 },
];
/// Settling time of the averages of the demodulation, and averaging time of each axis at a start and at a self-commissioning, s.
const SETTLE_S: f32 = 0.02;
const AVERAGE_S: f32 = 0.24;
const LEARNING_S: f32 = 0.96;
/// Measurement at a start.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AtStart {
    /// Control periods in which a residual flux decays first.
    pub decay: u32,
    /// Asymmetry that was measured at the start of the self-commissioning, less the learned one. Later starts are compared with it. None
    /// if nothing was learned.
    pub learned: Option<Asymmetry>,
}

/// State of the measurement: sums of q.
#[derive(Clone, Copy, Debug)]
pub struct AtStartState {
    /// Averaging time per axis, control periods.
    average: u32,
    q: [f32; AXES.len()],
}

impl AtStart {
    /// Amplitude of the injection relative to the amplitude during operation. The larger current is acceptable, since the search of
    /// a flying start draws as much.
    pub const CARRIER_SHARE: f32 = 2.0;

    /// Processes the saliency without the known asymmetries, `elapsed` control periods after the beginning. Returns the injection axis
    /// for the next period, or `None` at the end.
    pub fn step(&self, state: &mut AtStartState, elapsed: u32, q: f32) -> Option<UnitVector> {
        let all = periods(SETTLE_S) + state.average;
        let elapsed = elapsed.saturating_sub(self.decay);
        let (number, of_axis) = (elapsed.checked_div(all)?, elapsed.checked_rem(all)?);
        let sum = state.q.get_mut(number as usize)?;
        if of_axis >= periods(SETTLE_S) {
            *sum += q;
        }
        AXES.get(number as usize).copied()
    }

    /// Returns the change of the asymmetry since the self-commissioning; none if nothing was learned.
    pub fn change(&self, state: &AtStartState) -> Option<Asymmetry> {
        Some(state.found().plus(&self.learned?, -1.0))
    }
}

impl AtStartState {
    /// Begins the measurement of a start. The measurement of a self-commissioning (`learns`), with which all later ones are
    /// compared, takes longer.
    pub fn new(learns: bool) -> Self {
        let average = periods(if learns { LEARNING_S } else { AVERAGE_S });
        Self { average, q: [0.0; AXES.len()] }
    }

    /// Returns the measured asymmetry beyond the known one.
    pub fn found(&self) -> Asymmetry {
        let [along_a, ahead, behind] = self.q.map(|sum| sum / self.average as f32);
        let constant = (along_a + ahead + behind) * (1.0 / 3.0);
        Asymmetry { constant, sin: (ahead - behind) * (1.0 / SQRT_3), cos: along_a - constant }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::Saliency;

    const WITHOUT_DECAY: AtStart = AtStart { decay: 0, learned: None };

    /// Returns the saliency that this asymmetry causes with the injection along `axis`.
    fn seen(of: &Asymmetry, axis: UnitVector) -> Saliency {
        let mut seen = Saliency { q: 0.0, carrier_squared: 0.05, i_q: 0.0 };
        let minus = Asymmetry::default().plus(of, -1.0);
        minus.take_out(&mut seen, axis);
        seen
    }

    /// Measures this asymmetry; while the averages settle, the value is `unsettled`.
    fn measured(of: &Asymmetry, unsettled: f32) -> (AtStartState, u32) {
        let (mut state, mut axis) = (AtStartState::new(false), AXES[2]);
        let at_start = AtStart { decay: 777, learned: None };
        for elapsed in 0..10_000_u32 {
            let measures = elapsed.saturating_sub(777) % periods(SETTLE_S + AVERAGE_S);
            let settles = measures < periods(SETTLE_S);
            let mut now = seen(of, axis);
            if settles {
                now.q = unsettled;
            }
            match at_start.step(&mut state, elapsed, now.q) {
                Some(next) => axis = next,
                None => return (state, elapsed),
            }
        }
        panic!("it does not end");
    }

    #[test]
    fn an_asymmetry_is_found_in_three_axes() {
        for (constant, sin, cos) in
            [(0.0, 0.0, 0.0), (-0.0029, 0.005, -0.0029), (0.006, -0.004, -0.003), (0.0, 0.0, 0.01)]
        {
            let asymmetry = Asymmetry { constant, sin, cos };
            let (state, took) = measured(&asymmetry, 1.0);
            assert_eq!(took, 777 + 3 * 1560);
            assert!(state.found().plus(&asymmetry, -1.0).size() < 1e-5, "{:?}", state.found());
        }
    }

    /// White noise of 0.2 % at twice the injection, which the demodulation averages over four injection periods, causes an error of 0.024
    /// % rms of a change.
    #[test]
    fn noise_makes_a_small_error() {
        let mut x = 1_u32;
        let mut white = || {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            2.0 * SQRT_3 * ((x >> 8) as f32 / (1 << 24) as f32 - 0.5)
        };
        let mut sum = 0.0;
        let mut start = |learns| {
            let (mut state, mut last) = (AtStartState::new(learns), [0.0; 4]);
            for elapsed in 0..3 * (120 + state.average) {
                if elapsed % 10 == 0 {
                    last = [white(), last[0], last[1], last[2]];
                }
                let [a, b, c, d] = last;
                let q = 0.002 * (a + 3.0 * b + 3.0 * c + d) / 8.0;
                WITHOUT_DECAY.step(&mut state, elapsed, q);
            }
            state
        };
        for _ in 0..1000 {
            let changed = Asymmetry { constant: 0.0, sin: 0.005, cos: 0.0 };
            let learned = start(true).found().plus(&changed, -1.0);
            let at_start = AtStart { learned: Some(learned), ..WITHOUT_DECAY };
            let error = at_start.change(&start(false)).unwrap().plus(&changed, -1.0);
            sum += error.size() * error.size();
        }
        let rms = fpu_sqrt::sqrtf(sum / 1000.0);
        assert!((2.0e-4..2.8e-4).contains(&rms), "{rms}");
        assert!(WITHOUT_DECAY.change(&start(false)).is_none());
    }
}
