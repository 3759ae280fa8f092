//! Tests of the recursive least squares on samples of the machine.

use std::f64::consts::TAU;

use induction_drive_core::{AlphaBeta, Motor};
use induction_drive_rotor_id::rls::{Rls, RlsError, RlsSettings};
use num_complex::Complex64;

use crate::machine::{J, Machine};

const H: f64 = 50e-6;
const OMEGA_M: f64 = 200.0;
/// 311 V over 3.5 A are about the impedance of the motor at 60 Hz.
const SETTINGS: RlsSettings = RlsSettings::paper(180.0, 5.0);
/// Samples until the filters have settled, and samples of the memory.
const SETTLE: usize = 212;
const MEMORY: usize = 1000;

/// Voltage of the machine.
#[derive(Clone, Copy)]
enum Signal {
    /// 60 Hz and five more sinusoids.
    Rich,
    /// The same signal along phase a alone.
    OneAxis,
    Nothing,
}

impl Signal {
    fn at(self, n: usize) -> Complex64 {
        let t = n as f64 * H;
        let at = |hz: f64| (J * TAU * hz * t).exp();
        let rich =
            150.0 * at(60.0) + 40.0 * (at(-25.0) + at(95.0) + at(-110.0) + at(190.0) + at(10.0));
        match self {
            Self::Rich => rich,
            Self::OneAxis => rich.re.into(),
            Self::Nothing => Complex64::ZERO,
        }
    }
}

fn single(x: Complex64) -> AlphaBeta {
    AlphaBeta::new(x.re as f32, x.im as f32)
}

/// Machine and estimator.
#[derive(Clone, Copy)]
struct Bench {
    machine: Machine,
    rls: Rls,
    n: usize,
}

impl Bench {
    fn new(settings: RlsSettings) -> Self {
        let machine = Machine::new(&Motor::default(), OMEGA_M);
        Self { machine, rls: Rls::new(settings).unwrap(), n: 0 }
    }

    /// Runs one sample and returns voltage and current.
    fn step(&mut self, signal: Signal) -> (Complex64, Complex64) {
        let (v, i) = (signal.at(self.n), self.machine.current);
        self.rls.step(single(v), single(i));
        self.machine.advance(v, H);
        self.n += 1;
        (v, i)
    }

    fn steps(&mut self, signal: Signal, count: usize) {
        for _ in 0..count {
            self.step(signal);
        }
    }

    /// Runs samples until the condition holds and returns their number.
    fn until(&mut self, signal: Signal, holds: impl Fn(&Rls) -> bool) -> usize {
        (0..20_000)
            .find(|_| {
                self.step(signal);
                holds(&self.rls)
            })
            .unwrap_or(usize::MAX)
    }
}

#[test]
fn the_coefficients_predict_the_current_and_hold_the_speed() {
    let mut bench = settled();
    let theta = bench.rls.coefficients().unwrap();
    let [g1, g0, h1, u0] = theta.map(|x| Complex64::new(x.re.into(), x.im.into()));
    // Im f1 / h (Eq. 42)
    assert!((g1.im / H - OMEGA_M).abs() < 0.5, "{}", g1.im / H);
    let data: Vec<_> = (0..2000).map(|_| bench.step(Signal::Rich)).collect();
    let (mut error, mut sum) = (0.0, 0.0);
    for w in data.windows(3) {
        let [(v0, i0), (v1, i1), (_, i2)] = [w[0], w[1], w[2]];
        let predicted = g1 * (i1 - i0) + g0 * i0 + h1 * (v1 - v0) + u0 * v0;
        error += (i2 - i1 - predicted).norm_sqr();
        sum += (i2 - i1).norm_sqr();
    }
    assert!(error < 1e-8 * sum, "{error} of {sum}");
    assert!(bench.rls.misfit() < 1e-3 && bench.rls.uncertainty() < 100.0);
}

/// Returns a bench whose estimator has converged.
fn settled() -> Bench {
    let mut bench = Bench::new(SETTINGS);
    bench.steps(Signal::Rich, 10_000);
    assert!(bench.rls.is_valid());
    assert_eq!(bench.rls.missing(), 0);
    bench
}

#[test]
fn it_is_valid_after_one_memory_of_good_samples() {
    let mut bench = settled();
    bench.rls.begin_at(bench.rls.latest());
    let first = bench.until(Signal::Rich, Rls::is_valid);
    assert!((MEMORY..MEMORY + 200).contains(&first), "{first}");
    // From zero, the errors of the first samples have to be forgotten as well.
    bench.rls.reset();
    assert!(!bench.rls.is_valid() && bench.rls.misfit() == 1.0);
    let first = bench.until(Signal::Rich, |rls| rls.missing() == 0);
    assert!((SETTLE..SETTLE + 100).contains(&first), "{first}");
    let first = bench.until(Signal::Rich, Rls::is_valid);
    assert!((MEMORY..8 * MEMORY).contains(&first), "{first}");
}

#[test]
fn without_a_signal_it_is_valid_for_one_more_memory() {
    let mut bench = settled();
    bench.until(Signal::Nothing, |rls| !rls.is_valid());
    assert_eq!(bench.rls.missing() as usize, MEMORY + 1);
    assert_eq!(bench.rls.coefficients(), None);
    let again = bench.until(Signal::Rich, Rls::is_valid);
    assert!((MEMORY..4 * MEMORY).contains(&again), "{again}");
}

/// The jump of the current shows at once. At 20 kHz its effect is over 0.12 s after the phase is closed.
#[test]
fn a_phase_that_opens_is_noticed() {
    let mut bench = settled();
    let mut until = |share: f64, valid: bool| {
        (0..20_000).find(|_| {
            let (v, mut i) = (Signal::Rich.at(bench.n), bench.machine.current);
            i.im *= share;
            bench.rls.step(single(v), single(i));
            bench.machine.advance(v, H);
            bench.n += 1;
            bench.rls.is_valid() == valid
        })
    };
    let (noticed, again) = (until(0.0, false).unwrap(), until(1.0, true).unwrap());
    assert!(noticed < 100 && (MEMORY..2400).contains(&again), "{again}");
}

#[test]
fn poor_excitation_is_never_valid() {
    for signal in [Signal::OneAxis, Signal::Nothing] {
        let mut bench = Bench::new(SETTINGS);
        bench.machine.rate = 0.0; // no rotor: the current stays along the axis
        bench.machine.omega_m = 0.0;
        assert_eq!(bench.until(signal, Rls::is_valid), usize::MAX);
        assert_eq!(bench.rls.missing(), 20_000);
        assert_eq!(bench.rls.misfit(), 1.0);
    }
    // The current has nothing to do with the voltage.
    let (mut rls, mut random) = (Rls::new(SETTINGS).unwrap(), 1_u32);
    for n in 0..20_000 {
        let mut uniform = || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(random) / f64::from(u32::MAX / 2) - 1.0
        };
        let current = 10.0 * Complex64::new(uniform(), uniform());
        rls.step(single(Signal::Rich.at(n)), single(current));
        assert!(!rls.is_valid());
    }
}

#[test]
fn a_sample_at_a_limit_is_left_out_and_the_filters_settle_anew() {
    let (v, i) = (SETTINGS.voltage_limit, SETTINGS.current_limit);
    assert_eq!((v, i), (1440.0, 40.0));
    let settled = settled();
    let along = |x: f32| [AlphaBeta::new(x, 0.0), AlphaBeta::new(0.0, -x)];
    for (volts, amperes) in [(v, 0.0), (0.0, i), (f32::NAN, 0.0), (0.0, f32::INFINITY)] {
        for n in 0..2 {
            let mut bench = settled;
            bench.rls.step(along(volts * 0.999)[n], along(amperes * 0.999)[n]);
            assert_eq!(bench.rls.missing(), u32::from(!(volts + amperes).is_finite()));
            let mut bench = settled;
            bench.rls.step(along(volts)[n], along(amperes)[n]);
            assert_eq!(bench.rls.missing(), 1);
            bench.steps(Signal::Rich, SETTLE);
            assert_eq!(bench.rls.missing() as usize, 1 + SETTLE);
            bench.step(Signal::Rich);
            assert_eq!(bench.rls.missing(), 0);
            assert!(bench.rls.is_valid());
        }
    }
}

/// The covariance is so small that nothing is learned and zero is predicted, so the error is the increment of
/// the filtered current.
#[test]
fn the_error_is_in_units_of_the_base() {
    let settings = RlsSettings { p0: 1e-3, lambda: 1.0, ..RlsSettings::paper(1000.0, 20.0) };
    let mut rls = Rls::new(settings).unwrap();
    rls.begin_at(Default::default());
    let (amperes, omega) = (0.22, 0.02); // per sample
    for n in 0..60_000 {
        let turn = (J * omega * f64::from(n)).exp();
        rls.step(single(20.0 * turn), single(amperes * turn));
    }
    let corner = f64::from(settings.corner);
    let gain = (1.0 + (omega / corner).powi(2)).powi(-3);
    let expected = (amperes / 20.0 * omega).powi(2) * gain;
    let square = f64::from(rls.error_square());
    assert!((square / expected - 1.0).abs() < 0.1, "{square} {expected}");
    assert!((rls.misfit() - 1.0).abs() < 0.1, "{}", rls.misfit());
}

#[test]
fn it_goes_on_from_what_was_found() {
    let mut bench = settled();
    let found = bench.rls.latest();
    bench.rls.begin_at(found);
    for (got, before) in bench.rls.latest().iter().zip(found) {
        assert!((got - before).norm() <= 1e-6 * before.norm());
    }
    assert!(!bench.rls.is_valid());
    // In D^-1/2 U^-1 x, x is in siemens as in `latest`: P0 = 1e6 in units of the bases.
    bench.rls.begin_at(found);
    let siemens: f64 = (SETTINGS.current_base / SETTINGS.voltage_base).into();
    let one = Complex64::from(siemens);
    let column = [Complex64::ZERO, Complex64::ONE, one, one]
        .map(|x| num_complex::Complex32::new(x.re as f32, x.im as f32));
    for (n, x) in bench.rls.whitened(column).into_iter().enumerate() {
        let expected = if n == 0 { 0.0 } else { 1e-3 };
        assert!((x.re - expected).abs() < 1e-8 && x.im == 0.0, "{n}: {x}");
    }
}

#[test]
fn settings_are_refused_beyond_their_bounds_and_taken_at_them() {
    type Set = fn(&mut RlsSettings, f32);
    let cases: [(Set, [f32; 2], RlsError); 6] = [
        (|s, x| s.lambda = x, [0.9, 1.0], RlsError("lambda")),
        (|s, x| s.p0 = x, [1e-3, 1e7], RlsError("p0")),
        (|s, x| s.corner = x, [1e-3, 1.0], RlsError("corner")),
        (|s, x| s.voltage_limit = x * s.voltage_base, [0.1, 100.0], RlsError("a limit")),
        (|s, x| s.current_limit = x * s.current_base, [0.1, 100.0], RlsError("a limit")),
        (|s, x| (s.voltage_base, s.voltage_limit) = (x, x), [1.1e-9, 0.9e9], RlsError("a base")),
    ];
    let settings = RlsSettings::paper(128.0, 4.0);
    for (set, [least, most], error) in cases {
        let result = |x: f32| {
            let mut s = settings;
            set(&mut s, x);
            Rls::new(s).map(|_| ())
        };
        assert_eq!((result(least), result(most)), (Ok(()), Ok(())), "{error:?}");
        assert_eq!((result(0.8 * least), result(1.2 * most)), (Err(error), Err(error)));
        assert_eq!(result(f32::NAN), Err(error));
    }
    let current = RlsSettings { current_base: 0.0, ..settings };
    assert_eq!(Rls::new(current).map(|_| ()), Err(RlsError("a base")));
}
