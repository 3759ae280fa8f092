//! Tests of single precision, which is sufficient for the sections, but not for the printed direct form.

use core::f64::consts::TAU;

use induction_drive_core::filter::{BPF, LPF_AS_PRINTED, PP, Section, Sos, SosState};

use super::db;
use super::printed::{Direct32, Direct64, Printed, TABLE_7_LPF, TABLE_8_BPF, TABLE_8_PP};
use super::{RATE, is_stable, largest_distance, rad};

/// Random numbers by xorshift64*, uniform in [-1, 1).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11;
        bits as f64 / (1u64 << 52) as f64 - 1.0
    }
}

type Input = Box<dyn FnMut(usize) -> f32>;

/// Returns typical inputs of the filters, currents up to 3 A.
fn inputs() -> [(&'static str, Input); 3] {
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let sine = |f: f64, k: usize| libm::sin(TAU * (f * k as f64 / RATE));
    [
        ("white noise", Box::new(move |_| (3.0 * noise.next()) as f32)),
        ("dc", Box::new(|_| 3.0)),
        (
            "3.7 Hz and injection",
            Box::new(move |k| (2.74 * sine(3.7, k) + 0.26 * sine(600.0, k)) as f32),
        ),
    ]
}

/// Returns the rms and the largest difference of two filters over `samples`.
fn difference(
    samples: usize,
    mut input: impl FnMut(usize) -> f32,
    mut one: impl FnMut(f32) -> f64,
    mut other: impl FnMut(f32) -> f64,
) -> (f64, f64) {
    let (mut square, mut largest) = (0.0, 0.0f64);
    for k in 0..samples {
        let u = input(k);
        let d = one(u) - other(u);
        square += d * d;
        largest = largest.max(d.abs());
    }
    (libm::sqrt(square / samples as f64), largest)
}

const LONG: usize = 600_000;

fn sections_against_double<const N: usize, const M: usize>(
    name: &str,
    filter: &Sos<N>,
    printed: &Printed<M>,
) {
    for (signal, input) in inputs() {
        let mut state = SosState::default();
        let mut reference = Direct64::new(printed);
        let (rms, largest) = difference(
            LONG,
            input,
            |u| f64::from(filter.step(&mut state, u)),
            |u| reference.step(f64::from(u)),
        );
        assert!(rms <= 2e-5 && largest <= 1e-4, "{name}, {signal}: {rms:e} {largest:e}");
    }
}

#[test]
fn single_precision_sections_follow_the_printed_filters() {
    sections_against_double("LPF", &LPF_AS_PRINTED, &TABLE_7_LPF);
    sections_against_double("BPF", &BPF, &TABLE_8_BPF);
    sections_against_double("PP", &PP, &TABLE_8_PP);
}

fn direct_single_against_double<const M: usize>(printed: &Printed<M>) -> [f64; 3] {
    inputs().map(|(_, input)| {
        let mut single = Direct32::new(printed);
        let mut reference = Direct64::new(printed);
        difference(LONG, input, |u| f64::from(single.step(u)), |u| reference.step(f64::from(u))).0
    })
}

/// Shows why there are sections: with the printed coefficients in single precision, Eq. C.1 is off by
/// as much as the signal for which the source looks.
#[test]
fn single_precision_direct_form_is_useless() {
    let lpf = direct_single_against_double(&TABLE_7_LPF);
    let pp = direct_single_against_double(&TABLE_8_PP);
    assert!(lpf.into_iter().chain(pp).all(|rms| rms >= 0.8e-3), "{lpf:?} {pp:?}");
}

/// "The performance of the filters is sensitive to the precision of their coefficients" (Appendix C).
#[test]
fn rounding_the_printed_coefficients() {
    let w = rad(600.0);
    let single = TABLE_7_LPF.rounded();
    let notch = db(single.response(w));
    let moved = largest_distance(|w| single.response(w), |w| TABLE_7_LPF.response(w));
    let pp_dc = TABLE_8_PP.rounded().response(0.0).re;
    assert!((notch + 41.8).abs() < 0.05 && (moved - 0.028).abs() < 0.001, "{notch} {moved}");
    assert!((pp_dc - 0.93942).abs() < 1e-5, "{pp_dc}");

    // The filter is still stable, but its response is wrong.
    let lpf = [TABLE_7_LPF.largest_pole(), single.largest_pole()];
    let pp = [TABLE_8_PP.largest_pole(), TABLE_8_PP.rounded().largest_pole()];
    assert!((lpf[0] - 0.988814).abs() < 2e-6 && (lpf[1] - 0.988863).abs() < 2e-6, "{lpf:?}");
    assert!((pp[0] - 0.983195).abs() < 2e-6 && (pp[1] - 0.983254).abs() < 2e-6, "{pp:?}");

    let decimals = |scale: f64| move |c: f64| libm::round(c * scale) / scale;
    for (scale, lpf, pp) in [(1e3, 1.0758, 1.085), (1e4, 0.98072, 1.0)] {
        let found = (
            TABLE_7_LPF.map(decimals(scale)).largest_pole(),
            TABLE_8_PP.map(decimals(scale)).largest_pole(),
        );
        assert!((found.0 - lpf).abs() < 2e-4 && (found.1 - pp).abs() < 5e-4, "{scale}: {found:?}");
    }
    // With four decimals, the sections are stable with a margin.
    for filter in [LPF_AS_PRINTED.sections.as_slice(), &BPF.sections, &PP.sections] {
        for s in filter {
            let four = |c: f32| (decimals(1e4)(f64::from(c))) as f32;
            assert!(is_stable(&Section { a1: four(s.a1), a2: four(s.a2), ..*s }));
        }
    }
}
