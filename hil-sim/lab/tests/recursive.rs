//! The recursive form of drive-core against `f64`: assertions R1 to R3.

use std::f64::consts::TAU;

use drive_core::AlphaBeta;
use num_complex::{Complex as Of, Complex32};
use num_traits::Float;
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use rotor_id::rls::{Rls, RlsSettings};
use sim_lab::identification::models::model_c;
use sim_lab::identification::signals::{Filter, noise};
use sim_lab::identification::trial::{Noise, VOLTAGE, peaks};
use sim_lab::identification::{Complex, Delta, Parameters, Signal, Trial};

use crate::reference::Reference;

const H: f64 = 50e-6;
const CURRENT: f64 = 30.0;
const RATE: usize = 20_000;

fn trial(signal: Signal, speed: f64) -> Trial {
    Trial::printed(Parameters::PX.at(speed), signal, H, Noise::NONE)
}

fn rls(hz: f64) -> Rls {
    let corner = (5.0 * TAU * hz * H) as f32;
    Rls::new(RlsSettings { corner, ..RlsSettings::paper(VOLTAGE as f32, CURRENT as f32) })
        .expect("settings of the test")
}

fn single(x: Complex) -> AlphaBeta {
    AlphaBeta { alpha: x.re as f32, beta: x.im as f32 }
}

fn delta(theta: [Complex32; 4]) -> Delta {
    Delta::from_array(theta.map(|x| Complex::new(x.re.into(), x.im.into())))
}

fn cases() -> Vec<(Signal, f64)> {
    Signal::ALL.into_iter().flat_map(|signal| [375.0, 61.0].map(|speed| (signal, speed))).collect()
}

/// Measurements with this noise, without end.
fn samples(trial: Trial, level: Noise, seed: u64) -> impl Iterator<Item = (Complex, Complex)> {
    let [peak_v, peak_i] = peaks(trial.raw().skip(RATE).take(RATE / 5));
    let (largest_v, largest_i) = (level.voltage * peak_v, level.current * peak_i);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let noisy = move |(v, i)| (v + noise(&mut rng, largest_v), i + noise(&mut rng, largest_i));
    trial.raw().skip(RATE).map(noisy)
}

struct Comparison {
    omega_rms: f64,
    /// Median relative difference of each parameter of Model C.
    medians: [f64; 5],
}

fn compare(signal: Signal, speed: f64, level: Noise, seconds: usize) -> Comparison {
    let trial = trial(signal, speed);
    let mut single_precision = rls(trial.hz);
    let mut double = Reference::new(0.999, 1e6);
    let filter = Filter::new(5.0 * TAU * trial.hz, H);
    let (mut on_v, mut on_i) = (filter, filter);
    let (mut square, mut count) = (0.0, 0);
    let mut differences = [(); 5].map(|()| Vec::new());
    for (n, (v, i)) in samples(trial, level, 3).take(seconds * RATE).enumerate() {
        single_precision.step(single(v), single(i));
        // The same data in single precision, as the ADC and the modulator give them.
        let rounded = |x: Complex| Complex::new(f64::from(x.re as f32), f64::from(x.im as f32));
        double.step(on_v.step(rounded(v) / VOLTAGE), on_i.step(rounded(i) / CURRENT));
        assert!(single_precision.uncertainty() > 0.0 && single_precision.uncertainty() < 1e9);
        if n < RATE {
            continue;
        }
        let admittance = CURRENT / VOLTAGE;
        let Delta { g1, g0, h1, u0 } = double.delta();
        let reference = Delta { g1, g0, h1: h1 * admittance, u0: u0 * admittance };
        let ours = delta(single_precision.latest());
        square += ((ours.g1 - reference.g1).im / H).powi(2);
        count += 1;
        if n % 100 == 0 {
            let pairs = std::iter::zip(model_c(&ours, H).array(), model_c(&reference, H).array());
            for (difference, (a, b)) in differences.iter_mut().zip(pairs) {
                difference.extend(a.ok().zip(b.ok()).map(|(a, b)| (a / b - 1.0).abs()));
            }
        }
    }
    let medians = differences.map(|mut all: Vec<f64>| {
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    });
    Comparison { omega_rms: (square / f64::from(count)).sqrt(), medians }
}

#[test]
fn r1_sixty_seconds_in_single_precision() {
    let runs: Vec<_> = cases()
        .into_iter()
        .flat_map(|case| [Noise::NONE, Noise::PRINTED].map(|level| (case, level)))
        .collect();
    let results: Vec<_> = runs
        .par_iter()
        .map(|&((signal, speed), level)| compare(signal, speed, level, 60))
        .collect();
    for result in &results {
        assert!(result.omega_rms < 0.02, "{} rad/s", result.omega_rms);
        assert!(result.medians.iter().all(|m| *m < 1e-3), "{:?}", result.medians);
    }
}

/// The plain recursion on Eq. 14 as textbooks print it: with g = P conj(x), K = g / (lambda + x g) and P = (P - K gᴴ) /
/// lambda.
///
/// It fails in `f32` and in `f64`: P loses first its symmetry, then its sign.
#[derive(Clone, Copy, Debug)]
struct Plain<T> {
    lambda: T,
    theta: [Of<T>; 4],
    p: [[Of<T>; 4]; 4],
    /// Voltage and current of the last two samples, newest first.
    samples: [[Of<T>; 2]; 2],
    count: u32,
}

impl<T: Float> Plain<T> {
    /// Starts with all coefficients zero and P0 = `p0` I.
    fn new(lambda: T, p0: T) -> Self {
        let zero = Of::new(T::zero(), T::zero());
        let mut p = [[zero; 4]; 4];
        for (k, row) in p.iter_mut().enumerate() {
            row[k].re = p0;
        }
        Self { lambda, theta: [zero; 4], p, samples: [[zero; 2]; 2], count: 0 }
    }

    /// Processes one filtered sample.
    fn step(&mut self, v: Of<T>, i: Of<T>) {
        let [[v1, v2], [i1, i2]] = self.samples;
        self.samples = [[v, v1], [i, i1]];
        self.count = self.count.saturating_add(1);
        if self.count > 3 {
            self.update([i1, i2, v1, v2], i);
        }
    }

    fn update(&mut self, x: [Of<T>; 4], y: Of<T>) {
        let zero = Of::new(T::zero(), T::zero());
        let sum = |f: &dyn Fn(usize) -> Of<T>| (0..4).fold(zero, |sum, k| sum + f(k));
        let p = self.p;
        let column: [Of<T>; 4] = std::array::from_fn(|i| sum(&|k| p[i][k] * x[k].conj()));
        let alpha = sum(&|k| x[k] * column[k]) + self.lambda;
        let error = y - sum(&|k| x[k] * self.theta[k]);
        for i in 0..4 {
            let gain = column[i] / alpha;
            self.theta[i] = self.theta[i] + gain * error;
            for j in 0..4 {
                self.p[i][j] = (p[i][j] - gain * column[j].conj()) / self.lambda;
            }
        }
    }

    /// Smallest real part on the diagonal of P: positive as long as P is a covariance.
    fn smallest(&self) -> T {
        (0..4).map(|k| self.p[k][k].re).fold(T::infinity(), |a, b| if b < a { b } else { a })
    }

    /// Whether P and the estimate are finite.
    fn is_finite(&self) -> bool {
        self.p.iter().flatten().chain(&self.theta).all(|x| x.re.is_finite() && x.im.is_finite())
    }
}

#[test]
fn r2_the_plain_recursion_fails() {
    for (signal, speed) in cases() {
        let trial = trial(signal, speed);
        let filter = Filter::new(5.0 * TAU * trial.hz, H);
        let (mut on_v, mut on_i) = (filter, filter);
        let mut single = Plain::<f32>::new(0.999, 1e6);
        let mut double = Plain::<f64>::new(0.999, 1e6);
        let mut lost = [None; 2];
        for (n, (v, i)) in samples(trial, Noise::PRINTED, 3).take(10 * RATE).enumerate() {
            let (v, i) = (on_v.step(v / VOLTAGE), on_i.step(i / CURRENT));
            let narrow = |x: Complex| Of::new(x.re as f32, x.im as f32);
            single.step(narrow(v), narrow(i));
            double.step(v, i);
            if !single.is_finite() || single.smallest() <= 0.0 {
                lost[0] = lost[0].or(Some(n));
            }
            if !double.is_finite() || double.smallest() <= 0.0 {
                lost[1] = lost[1].or(Some(n));
            }
        }
        assert!(lost[0].is_some_and(|n| n < RATE), "f32 must fail: {lost:?}");
        assert!(lost[1].is_some_and(|n| n < 3 * RATE), "f64 must fail, later: {lost:?}");
    }
}

/// Times after which r_s and tau_r stay within 10 % of their final values, s, by a moving median over 20 ms.
fn convergence(signal: Signal, speed: f64) -> [f64; 2] {
    let trial = trial(signal, speed);
    let mut estimator = rls(trial.hz);
    let mut values = [Vec::new(), Vec::new()];
    for (v, i) in samples(trial, Noise::NONE, 3).take(2 * RATE) {
        estimator.step(single(v), single(i));
        let estimate = model_c(&delta(estimator.latest()), H);
        values[0].push(estimate.r_s.unwrap_or(0.0));
        values[1].push(estimate.tau_r.unwrap_or(0.0));
    }
    let median = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    values.map(|values| {
        let end = median(&values[3 * RATE / 2..]);
        let outside = |n: &usize| (median(&values[n - 400..*n]) / end - 1.0).abs() > 0.1;
        let last = (400..values.len()).step_by(20).rfind(outside);
        last.unwrap_or(0) as f64 / RATE as f64
    })
}

#[test]
fn r3_convergence_times() {
    let times: Vec<_> =
        cases().into_iter().map(|(signal, speed)| convergence(signal, speed)).collect();
    let worst = |k: usize| times[k][0].max(times[k][1]);
    // Sg 375, Sg 61, Ss 375, Ss 61. The paper: about 0.2 s and 0.8 s.
    assert!(worst(0) <= 0.2 && worst(1) <= 0.8, "{times:?}");
    assert!(worst(3) < worst(1) && worst(2) < worst(0) && worst(0) < worst(1), "{times:?}");
}
