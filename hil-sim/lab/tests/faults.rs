//! The recursive form of drive-core with bad input (R4): its output stays finite, is flagged invalid, and becomes valid again in time.

use std::f64::consts::TAU;

use drive_core::AlphaBeta;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rotor_id::rls::{Rls, RlsError, RlsSettings};
use sim_lab::identification::signals::noise;
use sim_lab::identification::trial::{Noise, VOLTAGE, peaks};
use sim_lab::identification::{Complex, Parameters, Signal, Trial};

const H: f64 = 50e-6;
const RATE: usize = 20_000;
const CURRENT: f64 = 30.0;
/// Samples of good input before the fault, and the last sample of the fault.
const BEFORE: usize = 2 * RATE;
const RETURN: usize = 12 * RATE;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// No voltage.
    Zero,
    /// A constant voltage.
    Dc,
    /// One sine instead of the excitation.
    Sine,
    /// One sample that is not a number.
    OneNan,
    /// Only samples that are not a number.
    Nan,
    /// The ADC saturates.
    Saturated,
    /// Voltage as commanded, but no current.
    NoCurrent,
    /// Phase a is open: no current along alpha.
    OpenPhase,
}

#[derive(Clone, Copy, Debug)]
struct Result {
    /// Time from the beginning of the fault until the estimate is no longer reported as valid, s.
    flagged: f64,
    /// Largest error of the speed while the estimate is valid, rad/s.
    worst_valid: f64,
    /// Time from the end of the fault until the estimate is valid permanently, s.
    back: f64,
    /// The same time, counted from the last sample at which the ADC saturated. After a fault the current exceeds the
    /// range of the ADC for up to 0.24 s, and there is no valid input until then.
    back_from_good: f64,
    /// Error of the speed 0.2 s and 0.5 s after the end of the fault, rad/s.
    errors: [f64; 2],
}

fn run(signal: Signal, speed: f64, fault: Fault, level: Noise) -> Result {
    let machine = Parameters::PX.at(speed);
    let trial = Trial::printed(machine, signal, H, Noise::NONE);
    let truth = machine.delta(H).g1.im / H;
    let [peak_v, peak_i] = peaks(trial.raw().skip(RATE).take(RATE / 5));
    // The range of the ADC ends at one and a half times the largest current.
    let full_scale = 1.5 * peak_i;
    let settings = RlsSettings {
        corner: (5.0 * TAU * trial.hz * H) as f32,
        current_limit: (0.999 * full_scale) as f32,
        ..RlsSettings::paper(VOLTAGE as f32, CURRENT as f32)
    };
    let mut rls = Rls::new(settings).unwrap();
    let step = machine.continuous().exact(H);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(9);
    let mut x = nalgebra::Vector2::zeros();
    let mut last_bad = 0;
    let mut result =
        Result { flagged: 0.0, worst_valid: 0.0, back: 0.0, back_from_good: 0.0, errors: [0.0; 2] };
    for n in 0..RETURN + 2 * RATE {
        let faulty = (BEFORE..RETURN).contains(&n);
        let t = n as f64 * H;
        let mut v = signal.at(trial.hz, t);
        let mut i = x[0];
        match fault {
            Fault::Zero if faulty => v = Complex::ZERO,
            Fault::Dc if faulty => v = Complex::new(5.0, 2.0),
            Fault::Saturated if faulty => v *= 3.0,
            Fault::Sine if faulty => v = Complex::from_polar(VOLTAGE, TAU * trial.hz * t),
            _ => {}
        }
        x = step.advance(x, v);
        match fault {
            Fault::NoCurrent if faulty => x[0] = Complex::ZERO,
            Fault::OpenPhase if faulty => x[0].re = 0.0,
            _ => {}
        }
        if n < RETURN || i.re.abs().max(i.im.abs()) >= full_scale {
            last_bad = n;
        }
        i.re = i.re.clamp(-full_scale, full_scale);
        i.im = i.im.clamp(-full_scale, full_scale);
        v += noise(&mut rng, level.voltage * peak_v);
        i += noise(&mut rng, level.current * peak_i);
        if (fault == Fault::Nan && faulty) || (fault == Fault::OneNan && n == BEFORE) {
            i.im = f64::NAN;
        }
        let single = |x: Complex| AlphaBeta { alpha: x.re as f32, beta: x.im as f32 };
        if matches!(fault, Fault::NoCurrent | Fault::OpenPhase) && n == RETURN {
            // Keeps the estimate but resets its covariance.
            rls.begin_at(rls.latest());
        }
        rls.step(single(v), single(i));
        let latest = rls.latest();
        assert!(
            latest.iter().all(|x| x.is_finite()) && rls.uncertainty().is_finite(),
            "{fault:?} {n}"
        );
        let error = (f64::from(latest[0].im) / H - truth).abs();
        if rls.is_valid() && n > RATE {
            result.worst_valid = result.worst_valid.max(error);
        }
        if faulty && rls.is_valid() {
            result.flagged = (n + 1 - BEFORE) as f64 * H;
        }
        if n >= RETURN && !rls.is_valid() {
            result.back = (n + 1 - RETURN) as f64 * H;
            result.back_from_good = (n - last_bad) as f64 * H;
        }
        if n == RETURN + RATE / 5 {
            result.errors[0] = error;
        }
        if n == RETURN + RATE / 2 {
            result.errors[1] = error;
        }
    }
    result
}

#[test]
fn r4_bad_input() {
    let faults = [
        Fault::Zero,
        Fault::Dc,
        Fault::Sine,
        Fault::OneNan,
        Fault::Nan,
        Fault::Saturated,
        Fault::NoCurrent,
        Fault::OpenPhase,
    ];
    let mut failed = Vec::new();
    for fault in faults {
        for (signal, speed) in Signal::ALL.into_iter().flat_map(|s| [(s, 375.0), (s, 61.0)]) {
            let result = run(signal, speed, fault, Noise::NONE);
            let noisy = run(signal, speed, fault, Noise { voltage: 0.005, current: 0.02 });
            let open = matches!(fault, Fault::NoCurrent | Fault::OpenPhase);
            // Checked after 0.2 s, or, after an open phase and a reset of the covariance, after 0.5 s.
            let right = result.errors[usize::from(open)] < 0.1;
            let back = right && result.back_from_good <= 0.2 && noisy.back_from_good <= 0.2;
            // One bad sample is not a lasting fault. Saturated samples are ignored in the same way, and the remaining
            // ones can be sufficient. The flag is then true, and the estimate is right.
            let lasting = !matches!(fault, Fault::OneNan | Fault::Saturated);
            // Good data fade from the memory before the flag drops. Until then the estimate without noise is right,
            // except with an open phase.
            let longest = if open { 0.15 } else { 0.45 };
            let flagged = !lasting || result.flagged <= longest && noisy.flagged <= longest;
            let honest = lasting && open || result.worst_valid < 0.1;
            if !(back && flagged && honest) {
                failed.push((fault, signal, speed));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn settings_that_cannot_be_are_refused() {
    let good = RlsSettings::paper(180.0, 30.0);
    assert!(Rls::new(good).is_ok());
    let refused = |settings| Rls::new(settings).map(|_| ()).unwrap_err();
    assert_eq!(refused(RlsSettings { lambda: 1.01, ..good }), RlsError("lambda"));
    assert_eq!(refused(RlsSettings { p0: 0.0, ..good }), RlsError("p0"));
    assert_eq!(refused(RlsSettings { corner: f32::NAN, ..good }), RlsError("corner"));
    assert_eq!(refused(RlsSettings { current_base: 0.0, ..good }), RlsError("a base"));
    assert_eq!(refused(RlsSettings { current_limit: f32::INFINITY, ..good }), RlsError("a limit"));
}

#[test]
fn any_bits_leave_it_finite_and_it_comes_back() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
    let mut rls = Rls::new(RlsSettings::paper(VOLTAGE as f32, CURRENT as f32)).unwrap();
    for n in 0..500_000u32 {
        // Any bits, bits of numbers within the limits, and steps between the limits.
        let mut any = || match n / 50_000 % 3 {
            0 => f32::from_bits(rng.random()),
            1 => f32::from_bits(rng.random::<u32>() & 0xC2FF_FFFF),
            _ => {
                if rng.random() {
                    239.0
                } else {
                    -239.0
                }
            }
        };
        let v = AlphaBeta { alpha: any(), beta: any() };
        let i = AlphaBeta { alpha: any(), beta: any() };
        rls.step(v, i);
        let sound = rls.latest().iter().all(|x| x.is_finite()) && rls.uncertainty().is_finite();
        assert!(sound && rls.misfit().is_finite(), "{n}: {v:?} {i:?}");
    }
    let machine = Parameters::PX.at(375.0);
    let trial = Trial::printed(machine, Signal::Schroeder, H, Noise::NONE);
    for (v, i) in trial.raw().take(RATE) {
        let single = |x: Complex| AlphaBeta { alpha: x.re as f32, beta: x.im as f32 };
        rls.step(single(v), single(i));
    }
    let error = f64::from(rls.latest()[0].im) / H - machine.delta(H).g1.im / H;
    assert!(rls.is_valid() && error.abs() < 0.1, "{error}");
}
