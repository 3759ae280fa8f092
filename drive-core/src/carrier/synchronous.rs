//! Synchronous demodulation: the saliency as a dimensionless number.
//!
//! The sampled current is resolved along and across the injection axis. Both components are mixed with
//! the injection frequency and averaged twice over two injection periods:
//!
//! ```text
//! X = MA20 MA20 ( 2 i_along e^(-j 2 pi k/10) )       Y likewise from i_across
//! q = -Re( Y conj(X) ) / |X|^2
//! ```
//!
//! In the channels of the dm-qm frame, A = (X - Y)/sqrt2 and B = (X + Y)/sqrt2, this is ( |A|^2 - |B|^2 )
//! / |A + B|^2. Dividing by the component along the injection axis removes the injected amplitude, the dc
//! link and the leakage inductance; taking magnitudes removes the phase of the injection. The averages
//! have zeros at dc and at every multiple of 300 Hz, so the fundamental current, which leaks through the
//! printed band-pass, is rejected. They delay `q` by 19 samples (3.2 ms).
//!
//! The averages are evaluated once per injection period. Their weights rise by one per sample for twenty
//! samples and then fall, so over the ten samples of an injection period they are a constant and a ramp.
//! Two sums per signal are updated in every sample, `S = sum x` and `D = sum S`; once per injection
//! period
//!
//! ```text
//! 400 X = D[0] + (10 S + D)[1] + (20 S - D)[2] + (10 S - D)[3]        [n]: n injection periods ago
//! ```
//!
//! All sums restart with every injection period, so that rounding does not accumulate. The
//! [drive](crate::Drive) calls the functions that run once per injection period.

use crate::carrier::injection::CARRIER_SAMPLES;
use crate::carrier::{CarrierCurrent, CarrierSample, Saliency};

/// Sample of the injection period in which [`average_reference`](SynchronousState::average_reference) is
/// to be called: the reference current then has the same delay as the other signals.
pub const REFERENCE_AT: usize = 5;

/// Lag of the averages at their evaluation, one sample after the last sample that they contain, samples.
pub const AVERAGES_LAG: f32 = 20.0;

/// Mixed current: real and imaginary part along the axis, real and imaginary part across it.
type Mixed = [f32; 4];

/// Contributions of earlier injection periods to the average of one signal, A: its state in transposed form.
type Earlier = [f32; 3];

/// Adds one injection period and returns the average, times [`WEIGHTS`].
fn average(earlier: &mut Earlier, sum: f32, ramp: f32) -> f32 {
    const N: f32 = CARRIER_SAMPLES as f32;
    let [one, two, three] = *earlier;
    let (level, falling) = (N * sum, N * sum - ramp);
    *earlier = [level + ramp + two, level + falling + three, falling];
    ramp + one
}

/// Sum of the weights of the averages: two times twenty samples.
const WEIGHTS: f32 = (4 * CARRIER_SAMPLES * CARRIER_SAMPLES) as f32;

/// State of the demodulation.
#[derive(Clone, Copy, Debug, Default)]
pub struct SynchronousState {
    /// The sums `S` and `D` over the present injection period, A.
    sum: Mixed,
    ramp: Mixed,
    /// Sum over the previous injection period, A.
    last: Mixed,
    earlier: [Earlier; 4],
    /// X and Y, times [`WEIGHTS`], A.
    mean: Mixed,
    i_q_earlier: [f32; 3],
    /// The latest result.
    pub saliency: Saliency,
}

impl SynchronousState {
    /// Mixes one sample with the injection frequency and adds it to the sums; called in every control period.
    pub fn mix(&mut self, sample: &CarrierSample) {
        let (along, across) = sample.current.seen_from(sample.axis);
        let (c, s) = (sample.carrier.cos, sample.carrier.sin);
        let mixed = [along * c, along * s, across * c, across * s];
        for ((sum, ramp), x) in self.sum.iter_mut().zip(&mut self.ramp).zip(mixed) {
            *sum += x;
            *ramp += *sum;
        }
    }

    /// Updates the averages and restarts the sums; called once per injection period, after its last sample.
    pub fn average(&mut self) {
        for n in 0..self.sum.len() {
            self.mean[n] = average(&mut self.earlier[n], self.sum[n], self.ramp[n]);
        }
        self.last = self.sum;
        (self.sum, self.ramp) = ([0.0; 4], [0.0; 4]);
    }

    /// Averages the q-axis current reference `now`, A, over four injection periods with weights 1, 3, 3,
    /// 1 eighths; called once per injection period, in sample [`REFERENCE_AT`].
    pub fn average_reference(&mut self, now: f32) {
        let (i_q, [one, two, three]) = (0.125 * now, self.i_q_earlier);
        self.i_q_earlier = [3.0 * i_q + two, 3.0 * i_q + three, i_q];
        self.saliency.i_q = i_q + one;
    }

    /// Computes the saliency from the averages; called once per injection period, after
    /// [`average`](Self::average).
    pub fn update_saliency(&mut self) {
        // The mean of the mixed current is half the amplitude.
        const MEAN: f32 = 2.0 / WEIGHTS;
        let [x_re, x_im, y_re, y_im] = self.mean.map(|x| x * MEAN);
        let squared = x_re * x_re + x_im * x_im;
        let product = x_re * y_re + x_im * y_im;
        // NaN fails the comparison and propagates.
        self.saliency.q = if squared < LEAST { 0.0 } else { -product / squared };
        self.saliency.carrier_squared = squared;
    }

    /// Returns the injection current of the previous injection period.
    pub fn carrier_current(&self) -> CarrierCurrent {
        let [x_re, x_im, y_re, y_im] = self.last.map(|x| x * (2.0 / CARRIER_SAMPLES as f32));
        CarrierCurrent { along: (x_re, x_im), across: (y_re, y_im) }
    }
}

/// Squared injection current below which the saliency is reported as 0, A^2.
const LEAST: f32 = 5e-7;

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::carrier::injection::{CARRIER_COS, CARRIER_SIN, CarrierPeriod};
    use crate::printed::Demodulate;
    use crate::{AlphaBeta, Angle};
    use core::f64::consts::TAU;

    /// Returns sample `k` of a current, injected along `axis`.
    fn sample(current: AlphaBeta, axis: Angle, k: usize) -> CarrierSample {
        let k = k % CARRIER_SAMPLES;
        let (cos, sin) = (CARRIER_COS[k], CARRIER_SIN[k]);
        let carrier = CarrierPeriod { cos, sin, ..CarrierPeriod::default() };
        CarrierSample { current, axis: axis.unit_vector(), carrier }
    }

    /// The demodulation together with its calls once an injection period, in the samples in which the drive makes them.
    #[derive(Default)]
    pub(crate) struct InTurn {
        state: SynchronousState,
        k: usize,
        i_q: f32,
    }

    impl Demodulate for InTurn {
        fn step(&mut self, sample: &CarrierSample) -> f32 {
            self.state.mix(sample);
            match self.k % CARRIER_SAMPLES {
                0 => self.state.update_saliency(),
                REFERENCE_AT => self.state.average_reference(self.i_q),
                9 => self.state.average(),
                _ => {}
            }
            self.k += 1;
            self.state.saliency.q
        }
    }

    /// Runs an injection current of `amplitude` A in direction `turn` from the injection axis, on
    /// top of a fundamental of 3 A, until q is steady.
    fn steady(amplitude: f64, turn: f64, phase: f64) -> SynchronousState {
        let theta = 0.7;
        let axis = Angle::from_radians(theta as f32);
        let mut demodulation = InTurn { i_q: 1.5, ..InTurn::default() };
        for k in 0..505 {
            let carrier = amplitude * (TAU * k as f64 / 10.0 + phase).cos();
            let i = AlphaBeta::new(
                (carrier * (theta + turn).cos() + 2.0) as f32,
                (carrier * (theta + turn).sin() - 2.2) as f32,
            );
            demodulation.step(&sample(i, axis, k));
        }
        demodulation.state
    }

    #[test]
    fn q_is_the_turn_of_the_carrier_current_whatever_its_size_and_phase() {
        // A current turned by x from the axis has dm = cos(45° + x), qm = cos(45° - x) parts: q =
        // -sin(2x) / (2 cos^2 x) = -tan x.
        for (amplitude, phase) in [(0.26, 0.0), (0.26, 1.0), (0.05, 2.0), (0.5, -0.4)] {
            for x in [-0.1, -0.01, 0.0, 0.03] {
                let state = steady(amplitude, x, phase);
                let s = state.saliency;
                assert!(
                    (f64::from(s.q) + x.tan()).abs() < 2e-4,
                    "{amplitude} {phase} {x}: {}",
                    s.q
                );
                let carrier = f64::from(s.carrier_squared).sqrt();
                assert!((carrier / (amplitude * x.cos()) - 1.0).abs() < 1e-3);
                assert!((s.i_q - 1.5).abs() < 1e-4);
                let c = state.carrier_current();
                let amplitudes = [(c.along, x.cos()), (c.across, x.sin())];
                for ((re, im), share) in amplitudes {
                    let found = f64::from(re).hypot(f64::from(im));
                    assert!((found - amplitude * share.abs()).abs() < 1e-5, "{found}");
                }
            }
        }
    }

    /// Compares with the moving averages of the definition, in f64, on noise.
    #[test]
    fn the_averages_are_two_moving_averages_of_twenty_samples() {
        let (mut demodulation, axis) = (InTurn::default(), Angle::ZERO);
        let moving = |x: &[f64]| -> Vec<f64> {
            (0..x.len()).map(|n| x[n.saturating_sub(19)..=n].iter().sum::<f64>() / 20.0).collect()
        };
        let (mut x, mut mixed) = (1_u32, [Vec::new(), Vec::new()]);
        for k in 0..1000_usize {
            x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = (x >> 8) as f32 / 4e6 - 2.0;
            let given = sample(AlphaBeta::new(noise, 0.0), axis, k);
            demodulation.step(&given);
            let (c, s) = (f64::from(given.carrier.cos), f64::from(given.carrier.sin));
            let along = f64::from(noise) * f64::from(given.axis.cos);
            mixed[0].push(2.0 * along * c);
            mixed[1].push(2.0 * along * s);
            if k % 10 == 0 && k > 50 {
                // The values are those of the last sample of the injection period before.
                let [re, im] = mixed.each_ref().map(|m| moving(&moving(m))[k - 1]);
                let found = f64::from(demodulation.state.saliency.carrier_squared);
                assert!((found - (re * re + im * im)).abs() < 1e-5 * (1e-2 + found), "{k}");
            }
        }
    }

    #[test]
    fn nothing_is_left_of_what_was_four_carrier_periods_ago() {
        let (mut demodulation, axis) = (InTurn::default(), Angle::ZERO);
        for (k, x) in [(0, f32::NAN), (7, f32::INFINITY), (100_007, 3.0), (100_015, -4e3)] {
            (demodulation.k, demodulation.i_q) = (k, x);
            demodulation.step(&sample(AlphaBeta::new(x, -x), axis, k));
            demodulation.i_q = 0.0;
            for k in k + 1..k + 65 {
                demodulation.step(&sample(AlphaBeta::ZERO, axis, k));
            }
            assert_eq!(demodulation.state.saliency, Saliency::default(), "{x}");
        }
    }

    #[test]
    fn no_carrier_is_no_saliency_and_no_number_is_seen() {
        assert_eq!(steady(0.0, 0.0, 0.0).saliency.q, 0.0);
        let mut state = SynchronousState::default();
        state.mix(&sample(AlphaBeta::new(f32::NAN, 0.0), Angle::ZERO, 7));
        state.average();
        state.update_saliency();
        assert!(state.saliency.q.is_nan());
    }
}
