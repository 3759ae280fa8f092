//! Tests of each demodulation against the exact result, computed in f64 from the definition.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

use core::f64::consts::{SQRT_2, TAU};

use super::*;
use crate::carrier::CarrierSample;
use crate::carrier::injection::CarrierPeriod;
use crate::carrier::synchronous::tests::InTurn;
use crate::{AlphaBeta, Angle};

/// Gain (-0.490 dB) and phase of the band-pass at 600 Hz, and of the post-processing filter at dc.
const BPF_GAIN: f64 = 0.9452;
const BPF_PHASE: f64 = -3.86 / 360.0 * TAU;
const PP_DC: f64 = 0.944_061;

/// An injection current of the given amplitudes, A, in the dm and the qm channel, each with its own
/// phase, rad, on top of a fundamental of 3 A, with 50 V injected.
#[derive(Clone, Copy)]
struct Carried {
    dm: f64,
    qm: f64,
    phases: [f64; 2],
    fundamental: [f64; 2],
}

const CARRIED: Carried =
    Carried { dm: 0.20, qm: 0.17, phases: [0.3, 0.3], fundamental: [2.1, -2.1] };

impl Carried {
    fn sample(&self, k: usize) -> CarrierSample {
        let x = TAU * k as f64 / 10.0;
        let dm = self.fundamental[0] + self.dm * (x + self.phases[0]).cos();
        let qm = self.fundamental[1] + self.qm * (x + self.phases[1]).cos();
        let theta = 1.1_f64;
        let current = AlphaBeta::new(
            (dm * theta.cos() - qm * theta.sin()) as f32,
            (dm * theta.sin() + qm * theta.cos()) as f32,
        );
        let voltage = (50.0 * x.cos()) as f32;
        CarrierSample {
            current,
            axis: (Angle::from_radians(theta as f32) + Angle::EIGHTH).unit_vector(),
            carrier: CarrierPeriod {
                voltage,
                cos: x.cos() as f32,
                sin: x.sin() as f32,
                ..CarrierPeriod::default()
            },
        }
    }

    /// Returns the output of `demodulator` after a second, averaged over an injection period, and
    /// its ripple in that period.
    fn steady(&self, demodulator: &mut impl Demodulate) -> (f64, f64) {
        let mut out = [0.0_f64; 10];
        for k in 0..6000 {
            out[k % 10] = f64::from(demodulator.step(&self.sample(k)));
        }
        let (low, high) = out.iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
        (out.iter().sum::<f64>() / 10.0, high - low)
    }
}

#[test]
fn literal_is_the_leak_of_the_fundamental() {
    // 0.01 and 0.944 are the gains of the filters at dc. The output does not contain the injection.
    let expected = 0.01 * PP_DC * 4.2;
    for c in [CARRIED, Carried { dm: 0.0, qm: 0.0, ..CARRIED }] {
        let (mean, _) = c.steady(&mut Literal::default());
        assert!((mean / expected - 1.0).abs() < 2e-3, "{mean} {expected}");
    }
}

#[test]
fn rectified_is_the_difference_of_the_mean_magnitudes() {
    for phase in [0.0, 0.3, 1.0, 2.2] {
        let c = Carried { phases: [phase; 2], fundamental: [0.0; 2], ..CARRIED };
        // With ten samples a period, the value lies between 0.616 and 0.647, depending on the phase, and is 2/pi on average.
        let magnitude = |k: i32| (TAU * f64::from(k) / 10.0 + phase + BPF_PHASE).cos().abs();
        let mean_magnitude = (0..10).map(magnitude).sum::<f64>() / 10.0;
        let expected = mean_magnitude * BPF_GAIN * PP_DC * 0.03;
        let (mean, _) = c.steady(&mut Rectified::default());
        assert!((mean / expected - 1.0).abs() < 2e-3, "{phase}: {mean} {expected}");
    }
}

#[test]
fn envelope_is_the_difference_of_the_amplitudes_whatever_the_phase() {
    for phases in [[0.0, 0.0], [0.3, 1.0], [2.2, -1.3]] {
        for fundamental in [[0.0, 0.0], [2.1, -2.1]] {
            let c = Carried { phases, fundamental, ..CARRIED };
            let (mean, ripple) = c.steady(&mut Envelope::default());
            // The leakage, 21 mA at dc, adds at right angles: its square over the amplitude, in both channels.
            assert!((mean / (BPF_GAIN * 0.03) - 1.0).abs() < 0.02, "{phases:?}: {mean}");
            assert!(ripple < 2e-5, "{phases:?}: ripple {ripple} A");
        }
    }
}

#[test]
fn rms_impedance_is_the_difference_of_voltage_over_current() {
    let expected = 50.0 / SQRT_2 * (1.0 / 0.20 - 1.0 / 0.17) / BPF_GAIN * PP_DC;
    for samples in [5, 10, 20, 60] {
        let c = Carried { fundamental: [0.0; 2], ..CARRIED };
        let (mean, ripple) = c.steady(&mut RmsImpedance::new(samples));
        assert!((mean / expected - 1.0).abs() < 2e-3, "{samples}: {mean} {expected} ohm");
        assert!(ripple < 0.01, "{samples}: ripple {ripple} ohm");
    }
    // If the rms filters do not contain whole half periods, there is ripple, most of which F3 removes.
    let (mean, ripple) = CARRIED.steady(&mut RmsImpedance::new(13));
    assert!((mean / expected - 1.0).abs() < 0.05, "{mean}");
    assert!(ripple < 0.02 * expected.abs(), "{ripple}");
}

#[test]
fn rms_impedance_needs_a_current() {
    let c = Carried { dm: 0.0, qm: 0.0, fundamental: [0.0; 2], ..CARRIED };
    assert_eq!(c.steady(&mut RmsImpedance::new(20)), (0.0, 0.0));
    let mut one = CARRIED.sample(0);
    one.current = AlphaBeta::new(f32::NAN, f32::INFINITY);
    assert!(RmsImpedance::new(0).step(&one).is_finite());
}

#[test]
fn all_see_nothing_where_the_channels_are_alike() {
    let c = Carried { qm: 0.20, fundamental: [0.0; 2], ..CARRIED };
    let rest = [
        c.steady(&mut Literal::default()).0,
        c.steady(&mut Rectified::default()).0,
        c.steady(&mut Envelope::default()).0,
        c.steady(&mut RmsImpedance::new(20)).0 / 1000.0,
        c.steady(&mut InTurn::default()).0,
    ];
    for (n, x) in rest.into_iter().enumerate() {
        assert!(x.abs() < 2e-5, "{n}: {x}");
    }
}

/// Returns the mean delay of a small change of one injection current, samples: the area above the step response.
fn delay<D: Demodulate>(mut demodulator: D) -> f64 {
    let before = Carried { fundamental: [0.0; 2], ..CARRIED };
    let after = Carried { dm: before.dm + 0.002, ..before };
    let start = before.steady(&mut demodulator).0;
    let response: Vec<f64> =
        (0..6000).map(|k| f64::from(demodulator.step(&after.sample(k)))).collect();
    let end = response[5990..].iter().sum::<f64>() / 10.0;
    response[..1200].iter().map(|x| 1.0 - (x - start) / (end - start)).sum()
}

#[test]
fn delays_are_those_of_the_filters() {
    // The group delays are 8.83 for the band-pass at 600 Hz, 24.46 for the post-processing filter
    // at dc, half their length for the averages, and half the distance of its two samples for the
    // envelope.
    let found = [
        ("rectified", delay(Rectified::default()), 8.83 + 24.46),
        ("rms 20", delay(RmsImpedance::new(20)), 8.83 + 9.5 + 24.46),
        ("rms 60", delay(RmsImpedance::new(60)), 8.83 + 29.5 + 24.46),
        ("envelope", delay(Envelope::default()), 8.83 + 1.0 + 4.5),
        // 4.5 samples are due to the evaluation once an injection period, and 1 to the use in the first sample of the next period.
        ("synchronous", delay(InTurn::default()), 19.0 + 4.5 + 1.0),
    ];
    for (name, found, expected) in found {
        assert!((found - expected).abs() < 0.5, "{name}: {found} {expected}");
    }
}
