//! The filters of Appendix C against the printed tables, and the PI controller against Appendix B.

use core::f64::consts::{PI, TAU};

use drive_core::filters::{BPF, LPF, LPF_AS_PRINTED, PP, lpf_lag_samples};
use drive_core::pi::{DqPi, DqPiState, Pi, PiState, ReferenceFilter, ReferenceState};
use drive_core::sos::{AlphaBetaState, Complex, Section, Sos, SosState, response};
use drive_core::tuning::roots;
use drive_core::{AlphaBeta, Dq};
use proptest::prelude::*;

const RATE: f64 = 6000.0;

/// Table 7 and 8, Eq. C.1: numerator and denominator in falling powers of z, as printed.
struct Printed<const N: usize> {
    b: [f64; N],
    a: [f64; N],
}

const TABLE_7_LPF: Printed<9> = Printed {
    b: [
        0.738615833587383,
        -4.971982137583815,
        15.50148217060981,
        -28.98410634650692,
        35.43907690259563,
        -28.98410634650692,
        15.50148217060981,
        -4.971982137583815,
        0.738615833587383,
    ],
    a: [
        1.0,
        -6.311293551201974,
        18.46331078509279,
        -32.43610484934781,
        37.32214807164715,
        -28.7756581786344,
        14.5364179364932,
        -4.413169859261352,
        0.621866049065974,
    ],
};

const TABLE_8_BPF: Printed<5> = Printed {
    b: [
        0.02218769906303914,
        -0.02791079414758331,
        0.01263993354917355,
        -0.02791079414758331,
        0.02218769906303914,
    ],
    a: [
        1.0,
        -2.998_996_481_422_489,
        3.957_068_061_698_251,
        -2.583_022_544_970_399,
        0.744_322_313_016_577_5,
    ],
};

const TABLE_8_PP: Printed<5> = Printed {
    b: [
        0.00107990678715093,
        -0.00373680819442586,
        0.00535736614345009,
        -0.00373680819442586,
        0.00107990678715093,
    ],
    a: [
        1.0,
        -3.864_373_656_689_287,
        5.612_670_700_601_41,
        -3.630_999_600_151_319,
        0.882_748_700_857_614_4,
    ],
};

impl<const N: usize> Printed<N> {
    fn response(&self, omega_t: f64) -> Complex {
        let z = Complex::unit(omega_t);
        let of = |c: &[f64; N]| {
            c.iter().fold(Complex::default(), |sum, c| sum * z + Complex::new(*c, 0.0))
        };
        of(&self.b) / of(&self.a)
    }

    fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self { b: self.b.map(&f), a: self.a.map(f) }
    }

    /// Coefficients as an `f32` holds them.
    fn rounded(&self) -> Self {
        self.map(|c| f64::from(c as f32))
    }

    fn largest_pole<const M: usize>(&self) -> f64 {
        let mut monic = [0.0; M];
        monic.copy_from_slice(&self.a[1..]);
        roots(monic).expect("finite").iter().fold(0.0, |m, p| m.max(p.abs()))
    }
}

/// Eq. C.1 in double precision.
struct Direct64<'a, const N: usize> {
    of: &'a Printed<N>,
    u: [f64; N],
    y: [f64; N],
}

impl<'a, const N: usize> Direct64<'a, N> {
    fn new(of: &'a Printed<N>) -> Self {
        Self { of, u: [0.0; N], y: [0.0; N] }
    }

    fn step(&mut self, u: f64) -> f64 {
        self.u.rotate_right(1);
        self.y.rotate_right(1);
        self.u[0] = u;
        self.y[0] = 0.0;
        let sum = |c: &[f64; N], x: &[f64; N]| c.iter().zip(x).map(|(c, x)| c * x).sum::<f64>();
        self.y[0] = sum(&self.of.b, &self.u) - sum(&self.of.a, &self.y);
        self.y[0]
    }
}

/// Eq. C.1 as one would write it in single precision.
struct Direct32<const N: usize> {
    b: [f32; N],
    a: [f32; N],
    u: [f32; N],
    y: [f32; N],
}

impl<const N: usize> Direct32<N> {
    fn new(of: &Printed<N>) -> Self {
        let single = |c: [f64; N]| c.map(|c| c as f32);
        Self { b: single(of.b), a: single(of.a), u: [0.0; N], y: [0.0; N] }
    }

    fn step(&mut self, u: f32) -> f32 {
        self.u.rotate_right(1);
        self.y.rotate_right(1);
        self.u[0] = u;
        self.y[0] = 0.0;
        let mut y = 0.0;
        for i in 0..N {
            y += self.b[i] * self.u[i] - self.a[i] * self.y[i];
        }
        self.y[0] = y;
        y
    }
}

/// xorshift64*, uniform in [-1, 1).
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

/// Currents up to 3 A, as the filters get them.
fn inputs() -> [(&'static str, Input); 3] {
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let sine = |f: f64, k: usize| libm::sin(TAU * (f * k as f64 / RATE));
    [
        ("white noise", Box::new(move |_| (3.0 * noise.next()) as f32)),
        ("dc", Box::new(|_| 3.0)),
        (
            "3.7 Hz and carrier",
            Box::new(move |k| (2.74 * sine(3.7, k) + 0.26 * sine(600.0, k)) as f32),
        ),
    ]
}

/// rms and largest of the difference of two filters over `samples`.
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

fn rad(hz: f64) -> f64 {
    TAU * hz / RATE
}

/// Largest distance between two responses from dc to half the sampling rate.
fn largest_distance(one: impl Fn(f64) -> Complex, other: impl Fn(f64) -> Complex) -> f64 {
    (0..=6000)
        .map(|n| PI * f64::from(n) / 6000.0)
        .fold(0.0, |m, w| m.max((one(w) - other(w)).abs()))
}

#[test]
fn sections_have_the_printed_transfer_functions() {
    let lpf = largest_distance(|w| LPF_AS_PRINTED.response(w), |w| TABLE_7_LPF.response(w));
    let bpf = largest_distance(|w| BPF.response(w), |w| TABLE_8_BPF.response(w));
    let pp = largest_distance(|w| PP.response(w), |w| TABLE_8_PP.response(w));
    println!("largest |dH|: LPF {lpf:.2e}, BPF {bpf:.2e}, PP {pp:.2e}");
    assert!(lpf < 3.5e-6 && bpf < 1.5e-6 && pp < 6e-6);
    assert!(LPF_AS_PRINTED.is_stable() && LPF.is_stable() && BPF.is_stable() && PP.is_stable());
}

#[test]
fn gains() {
    for (name, gain, printed) in [
        ("LPF", LPF_AS_PRINTED.dc_gain(), 0.94406),
        ("BPF", BPF.dc_gain(), 0.01000),
        ("PP", PP.dc_gain(), 0.94406),
    ] {
        println!("{name} at dc: {gain:.6}");
        assert!((gain - printed).abs() < 1e-4, "{name}");
    }
    let at_600 = |h: Complex| h.db();
    let w = rad(600.0);
    let (lpf, unit) = (at_600(LPF_AS_PRINTED.response(w)), at_600(LPF.response(w)));
    println!("LPF at 600 Hz: {lpf:.3} dB as printed, {unit:.3} dB with unit gain at dc");
    assert!(lpf <= -48.0 && (lpf + 48.29).abs() < 0.01);
    assert!((unit + 47.79).abs() < 0.01);
    let bpf = BPF.response(w);
    assert!((bpf.db() + 0.490).abs() < 0.001 && (bpf.arg_deg() + 3.86).abs() < 0.01);
    assert!((PP.response(w).db() + 75.83).abs() < 0.01);
    assert!((PP.response(rad(1200.0)).db() + 62.73).abs() < 0.01);
    // The band stop lets everything above 650 Hz through: no anti-alias filter.
    assert!((LPF_AS_PRINTED.response(PI).db() + 0.5).abs() < 0.001);
}

#[test]
fn lpf_has_unit_gain_at_dc() {
    let error = LPF.dc_gain() - 1.0;
    println!("LPF at dc: 1 + {error:.2e}; at 60 Hz {:.5}", LPF.response(rad(60.0)).abs());
    // Rounding of the last section, whose zeros nearly cancel at dc.
    assert!(error.abs() < 3e-7);
    assert!((LPF.response(rad(60.0)).abs() - 1.00125).abs() < 1e-5);
    // Nothing else changes: same poles, same zeros.
    let scaled = |w| LPF_AS_PRINTED.response(w) * (1.0 / LPF_AS_PRINTED.dc_gain());
    assert!(largest_distance(|w| LPF.response(w), scaled) < 3e-6);

    // And so it settles on what it is fed: the noise of f32 is all that is left.
    let mut state = SosState::ZERO;
    let mut y = 0.0;
    for _ in 0..20_000 {
        y = LPF.step(&mut state, 3.0);
    }
    println!("3 A through LPF: {y} A");
    assert!((y - 3.0).abs() < 1e-5);
}

#[test]
fn group_delays() {
    for (name, delay, printed) in [
        ("LPF at dc", LPF.group_delay(0.0), 1.53),
        ("LPF at 200 Hz", LPF.group_delay(rad(200.0)), 2.46),
        ("BPF at dc", BPF.group_delay(0.0), 0.80),
        ("BPF at 600 Hz", BPF.group_delay(rad(600.0)), 8.83),
        ("PP at dc", PP.group_delay(0.0), 24.46),
        ("PP at 200 Hz", PP.group_delay(rad(200.0)), 4.0),
    ] {
        println!("{name}: {delay:.4} samples");
        assert!((delay - printed).abs() < 0.006, "{name}: {delay}");
    }
    // The formula against the difference quotient of the phase.
    for hz in [10.0, 100.0, 300.0, 700.0, 1500.0] {
        let (w, h) = (rad(hz), 1e-5);
        let turned = (BPF.response(w + h) / BPF.response(w - h)).arg();
        assert!((BPF.group_delay(w) + turned / (2.0 * h)).abs() < 1e-6, "{hz} Hz");
    }
}

#[test]
fn lag_of_lpf_up_to_60_hz() {
    let error_deg = |hz: f64| {
        let w = rad(hz);
        let lag = f64::from(lpf_lag_samples(w as f32)) * w;
        (lag + LPF.response(w).arg()) * (180.0 / PI)
    };
    let worst = (1..=600).map(|n| error_deg(f64::from(n) / 10.0).abs()).fold(0.0, f64::max);
    println!(
        "phase error: {worst:.5} deg up to 60 Hz, {:.4} at 100 Hz, {:.3} at 200 Hz",
        error_deg(100.0),
        error_deg(200.0)
    );
    assert!(worst < 2e-4);
    assert!(error_deg(100.0).abs() < 0.01 && error_deg(200.0).abs() < 0.5);
    assert_eq!(lpf_lag_samples(-0.05), lpf_lag_samples(0.05));
}

const LONG: usize = 600_000;

fn sections_against_double<const N: usize, const M: usize>(
    name: &str,
    filter: &Sos<N>,
    printed: &Printed<M>,
) {
    for (signal, input) in inputs() {
        let mut state = SosState::ZERO;
        let mut reference = Direct64::new(printed);
        let (rms, largest) = difference(
            LONG,
            input,
            |u| f64::from(filter.step(&mut state, u)),
            |u| reference.step(f64::from(u)),
        );
        println!("{name}, {signal}: rms {:.2} uA, largest {:.2} uA", rms * 1e6, largest * 1e6);
        assert!(rms <= 2e-5 && largest <= 1e-4, "{name}, {signal}: {rms:e} {largest:e}");
    }
}

#[test]
fn single_precision_sections_follow_the_printed_filters() {
    sections_against_double("LPF", &LPF_AS_PRINTED, &TABLE_7_LPF);
    sections_against_double("BPF", &BPF, &TABLE_8_BPF);
    sections_against_double("PP", &PP, &TABLE_8_PP);
}

fn direct_single_against_double<const M: usize>(name: &str, printed: &Printed<M>) -> [f64; 3] {
    inputs().map(|(signal, input)| {
        let mut single = Direct32::new(printed);
        let mut reference = Direct64::new(printed);
        let (rms, largest) = difference(
            LONG,
            input,
            |u| f64::from(single.step(u)),
            |u| reference.step(f64::from(u)),
        );
        println!(
            "{name} in direct form, {signal}: rms {:.2} mA, largest {:.1} mA",
            rms * 1e3,
            largest * 1e3
        );
        rms
    })
}

/// Why there are sections: the printed coefficients in single precision, run as Eq. C.1, are wrong by
/// as much as the signal the source looks for.
#[test]
fn single_precision_direct_form_is_useless() {
    for rms in direct_single_against_double("LPF", &TABLE_7_LPF) {
        assert!(rms >= 0.8e-3);
    }
    for rms in direct_single_against_double("PP", &TABLE_8_PP) {
        assert!(rms >= 0.8e-3);
    }
}

/// "The performance of the filters is sensitive to the precision of their coefficients" (Appendix C).
#[test]
fn rounding_the_printed_coefficients() {
    let w = rad(600.0);
    let single = TABLE_7_LPF.rounded();
    let notch = single.response(w).db();
    let moved = largest_distance(|w| single.response(w), |w| TABLE_7_LPF.response(w));
    let pp_dc = TABLE_8_PP.rounded().response(0.0).re;
    println!(
        "f32 coefficients, direct: LPF at 600 Hz {notch:.2} dB, |dH| {moved:.4}; PP at dc {pp_dc:.5}"
    );
    assert!((notch + 41.8).abs() < 0.05 && (moved - 0.028).abs() < 0.001);
    assert!((pp_dc - 0.93942).abs() < 1e-5);

    // Stable all the same; only the response is lost.
    let lpf = [TABLE_7_LPF.largest_pole::<8>(), single.largest_pole::<8>()];
    let pp = [TABLE_8_PP.largest_pole::<4>(), TABLE_8_PP.rounded().largest_pole::<4>()];
    println!("largest pole, exact and f32: LPF {lpf:.6?}, PP {pp:.6?}");
    assert!((lpf[0] - 0.988814).abs() < 2e-6 && (lpf[1] - 0.988863).abs() < 2e-6);
    assert!((pp[0] - 0.983195).abs() < 2e-6 && (pp[1] - 0.983254).abs() < 2e-6);

    let decimals = |scale: f64| move |c: f64| libm::round(c * scale) / scale;
    for (scale, lpf, pp) in [(1e3, 1.0758, 1.085), (1e4, 0.98072, 1.0)] {
        let found = (
            TABLE_7_LPF.map(decimals(scale)).largest_pole::<8>(),
            TABLE_8_PP.map(decimals(scale)).largest_pole::<4>(),
        );
        println!("rounded to 1/{scale}: LPF {:.5}, PP {:.5}", found.0, found.1);
        assert!((found.0 - lpf).abs() < 2e-4 && (found.1 - pp).abs() < 5e-4);
    }
    // The sections survive four decimals with a stable margin.
    for filter in [LPF_AS_PRINTED.sections.as_slice(), &BPF.sections, &PP.sections] {
        for s in filter {
            let four = |c: f32| (decimals(1e4)(f64::from(c))) as f32;
            assert!(Section { a1: four(s.a1), a2: four(s.a2), ..*s }.is_stable());
        }
    }
}

#[test]
fn responses_of_trivial_cascades() {
    assert_eq!(response(&[], 1.0), Complex::ONE);
    let delay = Sos { sections: [Section { b0: 0.0, b1: 1.0, ..Section::IDENTITY }] };
    assert!((delay.response(0.3) - Complex::unit(-0.3)).abs() < 1e-15);
    assert!((delay.group_delay(0.3) - 1.0).abs() < 1e-15);
    let mut state = SosState::ZERO;
    assert_eq!([1.0, 2.0, 3.0].map(|x| delay.step(&mut state, x)), [0.0, 1.0, 2.0]);
    // Unstable ones are seen as such.
    for (a1, a2) in [(0.0, 1.0), (-2.0, 1.0), (1.9, 0.5), (-1.9, 0.5), (f32::NAN, 0.0)] {
        assert!(!Section { a1, a2, ..Section::IDENTITY }.is_stable(), "{a1} {a2}");
    }
}

proptest! {
    #[test]
    fn a_vector_is_two_signals(xs in prop::collection::vec((-5f32..5.0, -5f32..5.0), 1..200)) {
        let mut both = AlphaBetaState::ZERO;
        let (mut alpha, mut beta) = (SosState::ZERO, SosState::ZERO);
        for (a, b) in xs {
            let y = LPF.step_alpha_beta(&mut both, AlphaBeta::new(a, b));
            // To the bit.
            prop_assert_eq!(y.alpha.to_bits(), LPF.step(&mut alpha, a).to_bits());
            prop_assert_eq!(y.beta.to_bits(), LPF.step(&mut beta, b).to_bits());
        }
    }

    #[test]
    fn linear(
        xs in prop::collection::vec((-3f32..3.0, -3f32..3.0), 1..400),
        p in -2f32..2.0,
        q in -2f32..2.0,
    ) {
        let (mut one, mut two, mut mixed) = (SosState::ZERO, SosState::ZERO, SosState::ZERO);
        for (x, y) in xs {
            let apart = p * PP.step(&mut one, x) + q * PP.step(&mut two, y);
            let together = PP.step(&mut mixed, p * x + q * y);
            prop_assert!((apart - together).abs() < 1e-4, "{} {}", apart, together);
        }
    }

    #[test]
    fn bounded_and_forgetting(xs in prop::collection::vec(-3f32..3.0, 1..2000)) {
        // The sums of |h| of `impulse_responses_sum_to_a_known_bound`.
        let (mut lpf, mut bpf, mut pp) = (SosState::ZERO, SosState::ZERO, SosState::ZERO);
        for x in xs {
            prop_assert!(LPF.step(&mut lpf, x).abs() < 3.0 * 4.18);
            prop_assert!(BPF.step(&mut bpf, x).abs() < 3.0 * 1.56);
            prop_assert!(PP.step(&mut pp, x).abs() < 3.0 * 1.66);
        }
        let mut left = 0f32;
        for _ in 0..6000 {
            left = LPF.step(&mut lpf, 0.0).abs();
            left = left.max(BPF.step(&mut bpf, 0.0).abs()).max(PP.step(&mut pp, 0.0).abs());
        }
        prop_assert!(left < 1e-6);
    }

    #[test]
    fn any_bits_go_through_and_reset_forgets_them(
        xs in prop::collection::vec(any::<u32>(), 1..50),
    ) {
        let mut scalar = SosState::ZERO;
        let mut vector = AlphaBetaState::ZERO;
        for bits in xs {
            let x = f32::from_bits(bits);
            LPF.step(&mut scalar, x);
            LPF.step_alpha_beta(&mut vector, AlphaBeta::new(x, -x));
        }
        LPF.step(&mut scalar, f32::NAN);
        LPF.step_alpha_beta(&mut vector, AlphaBeta::new(0.0, f32::INFINITY));
        prop_assert!(!scalar.is_finite() && !vector.is_finite());
        scalar.reset();
        vector.reset();
        prop_assert_eq!(scalar, SosState::default());
        prop_assert_eq!(vector, AlphaBetaState::default());
        prop_assert!(LPF.step(&mut scalar, 1.0).is_finite());
    }
}

#[test]
fn impulse_responses_sum_to_a_known_bound() {
    fn sum<const N: usize>(filter: &Sos<N>) -> f32 {
        let mut state = SosState::ZERO;
        (0..6000).map(|k| filter.step(&mut state, if k == 0 { 1.0 } else { 0.0 }).abs()).sum()
    }
    let sums = [sum(&LPF), sum(&BPF), sum(&PP)];
    println!("sum of |h|: LPF, BPF, PP {sums:.3?}");
    assert!(sums[0] < 4.18 && sums[1] < 1.56 && sums[2] < 1.66);
}

// ---- PI controller ----

/// Figure 40: an integrator y += sat(u, 0.15) under K_c = 0.25, z_c = 0.1, unit step.
struct Figure40 {
    y_max: f32,
    u_max: f32,
    u_at_crossing: f32,
    saturated: usize,
}

fn figure_40(anti_windup: bool) -> Figure40 {
    let pi = Pi { k_c: 0.25, z_c: 0.1 };
    let mut state = PiState::ZERO;
    let mut y = 0.0f32;
    let mut r = Figure40 { y_max: 0.0, u_max: 0.0, u_at_crossing: f32::NAN, saturated: 0 };
    for _ in 0..200 {
        let u = pi.step(&mut state, 1.0 - y);
        let applied = u.clamp(-0.15, 0.15);
        if anti_windup {
            state.realised(applied - u);
        }
        r.saturated += usize::from(applied != u);
        r.u_max = r.u_max.max(u);
        if y > 1.0 && r.u_at_crossing.is_nan() {
            r.u_at_crossing = u;
        }
        y += applied;
        r.y_max = r.y_max.max(y);
    }
    r
}

#[test]
fn anti_windup_of_figure_40() {
    let without = figure_40(false);
    let with = figure_40(true);
    for (name, r) in [("without", &without), ("with", &with)] {
        println!(
            "{name} anti-windup: y_max {:.4}, u_max {:.4}, u at crossing {:.4}, saturated {} of 200",
            r.y_max, r.u_max, r.u_at_crossing, r.saturated
        );
    }
    assert!((without.y_max - 2.005).abs() < 1e-3 && (without.u_max - 0.869).abs() < 1e-3);
    assert!((without.u_at_crossing - 0.854).abs() < 1e-3 && without.saturated == 153);
    assert!((with.y_max - 1.301).abs() < 1e-3 && with.saturated == 7);
}

/// Unit step of Eq. 3.39 on k/(z - p): overshoot in %, and the sample from which on the response
/// stays within 2 %.
fn step_of_3_39(p: f32, filtered: bool) -> (f32, usize) {
    let pi = Pi { k_c: 52.48, z_c: 0.94786 };
    let filter = ReferenceFilter::new(0.94786);
    let (mut state, mut reference) = (PiState::ZERO, ReferenceState::ZERO);
    let (mut y, mut peak, mut outside) = (0.0f32, 0.0f32, 0);
    for k in 0..2000 {
        if (y - 1.0).abs() > 0.02 {
            outside = k + 1;
        }
        let r = if filtered { filter.step(&mut reference, 1.0) } else { 1.0 };
        let u = pi.step(&mut state, r - y);
        y = p * y + 0.004_053_2 * u;
        peak = peak.max(y);
    }
    ((peak - 1.0).max(0.0) * 100.0, outside)
}

#[test]
fn step_response_of_section_3_8() {
    let nominal = step_of_3_39(0.93916, false);
    let filtered = step_of_3_39(0.93916, true);
    let slow = step_of_3_39(0.93916 * 1.03, false);
    let slow_filtered = step_of_3_39(0.93916 * 1.03, true);
    println!(
        "overshoot %, settling: {nominal:?} filtered {filtered:?}; pole x1.03 {slow:?} filtered {slow_filtered:?}"
    );
    assert!(nominal.0 < 1e-3 && nominal.1 == 25);
    assert!(filtered.0 < 1e-3 && filtered.1.abs_diff(82) <= 1);
    assert!((slow.0 - 4.27).abs() < 0.01);
    assert!(slow_filtered.0 < 1e-3);
}

#[test]
fn reference_filter_is_3_40() {
    let (filter, mut state) = (ReferenceFilter::new(0.75), ReferenceState::ZERO);
    // (1 - p)/(z - p): 0, 1 - p, (1 - p) p, ...
    let h = [1.0, 0.0, 0.0, 0.0].map(|x| filter.step(&mut state, x));
    assert_eq!(h, [0.0, 0.25, 0.1875, 0.140_625]);
    state.preset(3.0);
    assert_eq!(filter.step(&mut state, 3.0), 3.0);
    state.reset();
    assert_eq!(filter.step(&mut state, 1.0), 0.0);
}

#[test]
fn preset_goes_on_without_a_bump() {
    let pi = Pi { k_c: 55.0, z_c: 0.95 };
    let mut state = PiState::ZERO;
    state.preset(42.0, 0.0);
    assert_eq!(pi.step(&mut state, 0.0), 42.0);
    state.preset(42.0, 0.1);
    assert!((pi.step(&mut state, 0.1) - (42.0 + 55.0 * 0.05 * 0.1)).abs() < 1e-4);
    assert!((state.output() - 42.275).abs() < 1e-4);
}

#[test]
fn the_integrator_stops_below_the_stated_error() {
    let pi = Pi { k_c: 55.3, z_c: 0.9538 };
    let moves = |e: f32| {
        let mut state = PiState::ZERO;
        state.preset(180.0, e);
        pi.step(&mut state, e) != 180.0
    };
    assert!(!moves(2.5e-6) && moves(3.5e-6));
}

proptest! {
    #[test]
    fn two_axes_are_two_controllers(
        errors in prop::collection::vec((-5f32..5.0, -5f32..5.0), 1..200),
        limit in 1f32..200.0,
    ) {
        let pi = DqPi { d: Pi { k_c: 55.3, z_c: 0.9538 }, q: Pi { k_c: 51.2, z_c: 0.9534 } };
        let mut both = DqPiState::ZERO;
        let (mut d, mut q) = (PiState::ZERO, PiState::ZERO);
        for (e_d, e_q) in errors {
            let u = pi.step(&mut both, Dq::new(e_d, e_q));
            let (u_d, u_q) = (pi.d.step(&mut d, e_d), pi.q.step(&mut q, e_q));
            prop_assert_eq!((u.d.to_bits(), u.q.to_bits()), (u_d.to_bits(), u_q.to_bits()));
            let applied = Dq::new(u_d.clamp(-limit, limit), u_q.clamp(-limit, limit));
            both.realised(applied - u);
            d.realised(applied.d - u_d);
            q.realised(applied.q - u_q);
            prop_assert_eq!(both.output(), Dq::new(d.output(), q.output()));
            // Never wound up beyond the limit, but for rounding.
            prop_assert!(d.output().abs() <= limit * 1.000_001 + 1e-4);
        }
    }

    #[test]
    fn unlimited_there_is_no_leak(errors in prop::collection::vec(-5f32..5.0, 1..200)) {
        let pi = Pi { k_c: 55.3, z_c: 0.9538 };
        let (mut told, mut untold) = (PiState::ZERO, PiState::ZERO);
        for e in errors {
            let u = pi.step(&mut told, e);
            told.realised(0.0);
            prop_assert_eq!(u.to_bits(), pi.step(&mut untold, e).to_bits());
            prop_assert_eq!(told, untold);
        }
        // And with no error it holds its output for ever.
        pi.step(&mut told, 0.0);
        let held = told.output();
        for _ in 0..10_000 {
            prop_assert_eq!(pi.step(&mut told, 0.0), held);
        }
    }

    #[test]
    fn any_error_goes_through_and_reset_forgets_it(bits in any::<[u32; 8]>()) {
        let pi = DqPi { d: Pi { k_c: 55.3, z_c: 0.9538 }, q: Pi { k_c: 51.2, z_c: 0.9534 } };
        let mut state = DqPiState::ZERO;
        for b in bits {
            pi.step(&mut state, Dq::new(f32::from_bits(b), f32::NAN));
        }
        prop_assert!(!state.is_finite());
        state.reset();
        prop_assert_eq!(state, DqPiState::ZERO);
    }
}
