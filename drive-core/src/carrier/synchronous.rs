//! Synchronous demodulation: the saliency the carrier sees, as a pure number.
//!
//! The sampled current is seen along and across the injection axis, both parts are mixed with the
//! carrier's own frequency and averaged twice over two carrier periods:
//!
//! ```text
//! X = MA20 MA20 ( 2 i_along e^(-j 2 pi k/10) )       Y likewise from i_across
//! q = -Re( Y conj(X) ) / |X|^2
//! ```
//!
//! which is what the channels of the dm-qm frame, A = (X - Y)/sqrt2 and B = (X + Y)/sqrt2, give as
//! ( |A|^2 - |B|^2 ) / |A + B|^2. Dividing by the part along the injection axis takes the amplitude of the injection, the dc link and
//! the leakage inductance out; taking magnitudes takes the phase of the carrier out. The averages have
//! their zeros at dc and at every multiple of 300 Hz, so the fundamental current, which leaks through
//! the printed band-pass, is gone. They delay `q` by 19 samples (3.2 ms).
//!
//! The averages are looked at once a carrier period. Their weights rise by one a sample for twenty samples
//! and then fall, so over the ten samples of a carrier period they are a constant and a ramp: two sums
//! a signal are kept in every period, `S = sum x` and `D = sum S`, and once a carrier period
//!
//! ```text
//! 400 X = D[0] + (10 S + D)[1] + (20 S - D)[2] + (10 S - D)[3]        [n]: n carrier periods ago
//! ```
//!
//! All sums begin anew with every carrier period, so that no rounding adds up. What is done with those of
//! a whole one is the drive's to [call in turn](crate::Drive).

use crate::carrier::injection::CARRIER_SAMPLES;
use crate::carrier::{CarrierCurrent, CarrierSample, Saliency};

/// Sample of the carrier period in which the reference current is to be [seen](SynchronousState::see_reference):
/// it is then as old as the other signals are.
pub const REFERENCE_AT: usize = 5;

/// Of the mixed current along and across the axis: real and imaginary parts.
type Mixed = [f32; 4];

/// The two sums over a carrier period; A.
#[derive(Clone, Copy, Debug, Default)]
struct Period {
    sum: Mixed,
    ramp: Mixed,
}

/// What an average of one signal takes along of earlier carrier periods, A: transposed form.
#[derive(Clone, Copy, Debug, Default)]
struct Average {
    earlier: [f32; 3],
}

impl Average {
    /// Takes a carrier period in; the average, times [`WEIGHTS`].
    fn step(&mut self, sum: f32, ramp: f32) -> f32 {
        const N: f32 = CARRIER_SAMPLES as f32;
        let [one, two, three] = self.earlier;
        let (level, falling) = (N * sum, N * sum - ramp);
        self.earlier = [level + ramp + two, level + falling + three, falling];
        ramp + one
    }
}

/// Sum of the weights of the averages: two times twenty samples.
const WEIGHTS: f32 = (4 * CARRIER_SAMPLES * CARRIER_SAMPLES) as f32;

/// State of the demodulation.
#[derive(Clone, Copy, Debug, Default)]
pub struct SynchronousState {
    /// The carrier period that goes on.
    period: Period,
    /// Sum over the one before, A.
    last: Mixed,
    averages: [Average; 4],
    /// X and Y, times [`WEIGHTS`], A.
    mean: Mixed,
    i_q_earlier: [f32; 3],
    /// What was seen last.
    pub seen: Saliency,
}

impl SynchronousState {
    /// Mixes a sample.
    pub fn mix(&mut self, sample: &CarrierSample) {
        let (along, across) = sample.current.seen_from(sample.axis);
        let (c, s) = (sample.carrier.cos, sample.carrier.sin);
        let mixed = [along * c, along * s, across * c, across * s];
        let Period { sum, ramp } = &mut self.period;
        for ((sum, ramp), x) in sum.iter_mut().zip(ramp).zip(mixed) {
            *sum += x;
            *ramp += *sum;
        }
    }

    /// Once a carrier period, behind its last sample: averages, and begins the next.
    pub fn average(&mut self) {
        let Period { sum, ramp } = &mut self.period;
        for n in 0..sum.len() {
            self.mean[n] = self.averages[n].step(sum[n], ramp[n]);
            self.last[n] = sum[n];
            (sum[n], ramp[n]) = (0.0, 0.0);
        }
    }

    /// The same average of the reference of the quadrature current, A, of one sample in each of the carrier
    /// periods, that of [`REFERENCE_AT`]: 1, 3, 3, 1 eighths.
    pub fn see_reference(&mut self, now: f32) {
        let (i_q, [one, two, three]) = (0.125 * now, self.i_q_earlier);
        self.i_q_earlier = [3.0 * i_q + two, 3.0 * i_q + three, i_q];
        self.seen.i_q = i_q + one;
    }

    /// Once a carrier period, after [`average`](Self::average): the saliency.
    pub fn see(&mut self) {
        // The mean of the mixed current is half the amplitude.
        const MEAN: f32 = 2.0 / WEIGHTS;
        let [x_re, x_im, y_re, y_im] = self.mean.map(|x| x * MEAN);
        let squared = x_re * x_re + x_im * x_im;
        let product = x_re * y_re + x_im * y_im;
        // Not-a-number is not below the least.
        self.seen.q = if squared < LEAST { 0.0 } else { -product / squared };
        self.seen.carrier_squared = squared;
    }

    /// The carrier current in the carrier period before this one.
    pub fn carrier_current(&self) -> CarrierCurrent {
        let [x_re, x_im, y_re, y_im] = self.last.map(|x| x * (2.0 / CARRIER_SAMPLES as f32));
        CarrierCurrent { along: (x_re, x_im), across: (y_re, y_im) }
    }
}

/// Square of the carrier current below which there is no saliency to speak of, A^2.
const LEAST: f32 = 5e-7;

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::carrier::demodulator::Demodulate;
    use crate::carrier::injection::{CARRIER_COS, CARRIER_SIN, CarrierPeriod};
    use crate::math::angle::Angle;
    use crate::math::frames::AlphaBeta;
    use core::f64::consts::TAU;

    /// Sample `k` of a current, injected along `axis`.
    fn sample(current: AlphaBeta, axis: Angle, k: usize) -> CarrierSample {
        let k = k % CARRIER_SAMPLES;
        let (cos, sin) = (CARRIER_COS[k], CARRIER_SIN[k]);
        let carrier = CarrierPeriod { cos, sin, ..CarrierPeriod::default() };
        CarrierSample { current, axis: axis.unit_vector(), carrier }
    }

    /// The demodulation with what is done once a carrier period, when the drive does it.
    #[derive(Default)]
    pub(crate) struct InTurn {
        state: SynchronousState,
        k: usize,
        i_q: f32,
    }

    impl From<Saliency> for f32 {
        fn from(saliency: Saliency) -> Self {
            saliency.q
        }
    }

    impl Demodulate for InTurn {
        type Seen = Saliency;

        fn step(&mut self, sample: &CarrierSample) -> Saliency {
            self.state.mix(sample);
            match self.k % CARRIER_SAMPLES {
                0 => self.state.see(),
                REFERENCE_AT => self.state.see_reference(self.i_q),
                9 => self.state.average(),
                _ => {}
            }
            self.k += 1;
            self.state.seen
        }
    }

    /// Steady q for a carrier current of `amplitude` A in direction `turn` from the injection axis,
    /// on top of a fundamental of 3 A.
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
        // A carrier turned by x from the axis has dm = cos(45° + x), qm = cos(45° - x) parts:
        // q = -sin(2x) / (2 cos^2 x) = -tan x.
        for (amplitude, phase) in [(0.26, 0.0), (0.26, 1.0), (0.05, 2.0), (0.5, -0.4)] {
            for x in [-0.1, -0.01, 0.0, 0.03] {
                let state = steady(amplitude, x, phase);
                let s = state.seen;
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

    /// Against the moving averages of the definition, in f64, on noise.
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
            let seen = demodulation.step(&given);
            let (c, s) = (f64::from(given.carrier.cos), f64::from(given.carrier.sin));
            let along = f64::from(noise) * f64::from(given.axis.cos);
            mixed[0].push(2.0 * along * c);
            mixed[1].push(2.0 * along * s);
            if k % 10 == 0 && k > 50 {
                // As of the last sample of the carrier period before.
                let [re, im] = mixed.each_ref().map(|m| moving(&moving(m))[k - 1]);
                let found = f64::from(seen.carrier_squared);
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
            let mut rest = Saliency::default();
            for k in k + 1..k + 65 {
                rest = demodulation.step(&sample(AlphaBeta::ZERO, axis, k));
            }
            assert_eq!(rest, Saliency::default(), "{x}");
        }
    }

    #[test]
    fn no_carrier_is_no_saliency_and_no_number_is_seen() {
        assert_eq!(steady(0.0, 0.0, 0.0).seen.q, 0.0);
        let mut state = SynchronousState::default();
        state.mix(&sample(AlphaBeta::new(f32::NAN, 0.0), Angle::ZERO, 7));
        state.average();
        state.see();
        assert!(state.seen.q.is_nan());
    }
}
