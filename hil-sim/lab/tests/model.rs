//! The sampled machine and the least squares on it: assertions A1 to A4, and the exact inverse.

use nalgebra::DMatrix;
use sim_lab::identification::batch::{least_squares, parts};
use sim_lab::identification::models::{model_b, model_c, model_d, time_constant_roots};
use sim_lab::identification::trial::Noise;
use sim_lab::identification::{
    Complex, CurrentVoltage, Data, Delta, Estimate, FirstOrderTheta, NotIdentifiable, Parameters,
    Signal, Step, Trial,
};

const PERIODS: [f64; 3] = [50e-6, 100e-6, 200e-6];
const SPEEDS: [f64; 2] = [375.0, 61.0];
const MACHINES: [Parameters; 2] = [Parameters::PX, Parameters::RBV];

/// Model A with the eight real unknowns of Eq. 24, in that order.
fn real_regression(data: &Data) -> Result<[f64; 8], NotIdentifiable> {
    let (i, v) = (&data.i, &data.v);
    let count = i.len().min(v.len()).saturating_sub(2);
    let a = DMatrix::from_fn(2 * count, 8, |row, column| {
        let k = row / 2 + 1 - (column / 2) % 2;
        let x = if column < 4 { i[k] } else { v[k] };
        match (row % 2, column % 2) {
            (0, 0) | (1, 1) => x.re,
            (0, _) => -x.im,
            _ => x.im,
        }
    });
    let theta = least_squares(a, parts(i[2..].iter().take(count)))?.theta;
    Ok(std::array::from_fn(|k| theta[k]))
}

/// Stator resistance from the gain at zero frequency, 1/r_s = (h1 + h0)/(1 - f1 - f0): exact at any speed and period.
fn dc_resistance(delta: &Delta) -> Complex {
    -delta.g0 / delta.u0
}

/// Machines, speeds and periods of the paper.
fn cases() -> impl Iterator<Item = (Parameters, f64)> {
    let at = |machine: Parameters| SPEEDS.map(|w| machine.at(w));
    MACHINES.into_iter().flat_map(at).flat_map(|machine| PERIODS.map(|h| (machine, h)))
}

fn series(machine: &Parameters, h: f64) -> CurrentVoltage {
    machine.continuous().series(h, 5).current_voltage()
}

/// Largest difference of two sets of coefficients, each relative to its own magnitude.
fn apart(a: &CurrentVoltage, b: &CurrentVoltage) -> f64 {
    let pairs = [(a.f1, b.f1), (a.f0, b.f0), (a.h1, b.h1), (a.h0, b.h0)];
    pairs.map(|(a, b)| (a - b).norm() / b.norm()).into_iter().fold(0.0, f64::max)
}

/// Errors in %, in the order of the parameters.
fn percent(estimate: &Estimate, truth: &Parameters) -> [f64; 5] {
    let (estimate, truth) = (estimate.array(), truth.array());
    std::array::from_fn(|k| 100.0 * (estimate[k].expect("identifiable") / truth[k] - 1.0))
}

/// Largest difference of two steps, relative to the largest entry of the matrix that contains it.
fn steps_apart(a: &Step, b: &Step) -> f64 {
    let largest = |all: &[Complex]| all.iter().map(|x| x.norm()).fold(0.0, f64::max);
    let f = largest((a.f() - b.f()).as_slice()) / largest(b.f().as_slice());
    f.max(largest((a.h - b.h).as_slice()) / largest(b.h.as_slice()))
}

#[test]
fn a1_series_to_h5_against_the_exponential() {
    for (machine, h) in cases() {
        let exact = machine.continuous().exact(h);
        let step = machine.continuous().series(h, 5);
        let error = steps_apart(&step, &exact);
        let coefficients = apart(&step.current_voltage(), &exact.current_voltage());
        let bound = [5e-12, 1e-10, 1e-8][PERIODS.iter().position(|p| *p == h).unwrap()];
        // PX, with three times the coupling of RBV, reaches 1.3e-10 at 100 us.
        let bound = if machine.r_s == Parameters::RBV.r_s { bound } else { 1.5 * bound };
        assert!(error.max(coefficients) < bound, "{machine:?} {h}: {error:e} {coefficients:e}");
        let fine = machine.continuous().series(5e-6, 5).repeated((h / 5e-6).round() as u32);
        assert!(steps_apart(&fine, &exact) < 1e-13);
    }
}

#[test]
fn a1_test_vectors() {
    let c = |re, im| Complex::new(re, im);
    let px = CurrentVoltage {
        f1: c(1.98469619681, 0.0185267039989),
        f0: c(-0.9846992299, -0.0184652745106),
        h1: c(0.00840740921799, -2.93893991e-07),
        h0: c(-0.00839963207226, -0.000157217614529),
    };
    let rbv = CurrentVoltage {
        f1: c(1.98816237697, 0.0186177917091),
        f0: c(-0.988168661463, -0.0185303339769),
        h1: c(0.00233507552865, -4.27373374e-08),
        h0: c(-0.00233193328077, -4.36861287617e-05),
    };
    for (machine, printed) in [(Parameters::PX, px), (Parameters::RBV.at(375.0), rbv)] {
        let error = apart(&series(&machine, 50e-6), &printed);
        assert!(error < 1e-10, "{error:e}");
    }
}

#[test]
fn poles_are_those_of_the_continuous_machine() {
    for (machine, h) in cases() {
        let exact = machine.delta(h).current_voltage();
        for z in exact.delta().poles_minus_one().map(|e| e + 1.0) {
            assert!((z * z - exact.f1 * z - exact.f0).norm() < 1e-14);
            // Eq. 25, which prints |z² - f1 z - f0|² for real z, has these roots as well.
            let CurrentVoltage { f1, f0, .. } = exact;
            let c2 = f1.norm_sqr() - 2.0 * f0.re;
            let c1 = 2.0 * (f1.re * f0.re + f1.im * f0.im);
            let quartic = (((z - 2.0 * f1.re) * z + c2) * z + c1) * z + f0.norm_sqr();
            assert!(quartic.norm() < 1e-13, "{quartic}");
            assert!(z.norm() < 1.0);
        }
    }
}

#[test]
fn a2_least_squares_on_clean_data_is_exact_and_complex_equals_real() {
    for (machine, h) in cases() {
        for signal in Signal::ALL {
            let clean = Trial::printed(machine, signal, h, Noise::NONE).run(1, 0);
            let noisy = Trial::printed(machine, signal, h, Noise::PRINTED).run(1, 0);
            // Clean data come from the fine series, which equals the exponential to within 1e-13.
            let truth = machine.delta(h).current_voltage().array();
            let complex = clean.regression().unwrap().delta.current_voltage().array();
            for (estimated, truth) in complex.iter().zip(truth) {
                assert!((estimated - truth).abs() < 1e-10, "{machine:?} {h} {signal:?}");
            }
            for data in [&clean, &noisy] {
                let complex = data.regression().unwrap();
                let real = real_regression(data).unwrap();
                let complex = complex.delta.current_voltage().array();
                let worst = std::iter::zip(complex, real).map(|(c, r)| (c - r).abs());
                let worst = worst.fold(0.0, f64::max);
                assert!(worst < 1e-12, "{machine:?} {h} {signal:?}: {worst:e}");
            }
        }
    }
}

/// Machine, speed, period in µs, Model B and Model C, in %.
type Floor = (Parameters, f64, f64, [f64; 5], [f64; 5]);
#[rustfmt::skip]
const FLOORS: [Floor; 8] = [
    (Parameters::PX, 375.0, 50.0, [1.12, -18.92, 0.73, -18.01, -1.19], [0.40, -0.62, 0.002, -0.22, -1.19]),
    (Parameters::PX, 375.0, 100.0, [2.26, -31.76, 1.46, -30.24, -2.38], [0.80, -1.36, 0.009, -0.59, -2.38]),
    (Parameters::PX, 375.0, 200.0, [4.55, -48.07, 2.92, -45.78, -4.73], [1.62, -3.23, 0.039, -1.80, -4.73]),
    (Parameters::PX, 61.0, 50.0, [1.12, -0.58, 0.73, -0.88, -1.19], [0.40, -0.56, 0.002, -1.57, -1.19]),
    (Parameters::PX, 61.0, 200.0, [4.55, -2.25, 2.92, -3.44, -4.64], [1.61, -2.19, 0.033, -6.09, -4.64]),
    (Parameters::RBV, 375.0, 50.0, [0.59, -12.98, 0.53, -11.17, -0.71], [0.06, -0.32, 0.001, 1.22, -0.71]),
    (Parameters::RBV, 375.0, 200.0, [2.35, -37.21, 2.12, -32.02, -2.84], [0.24, -1.72, 0.022, 4.22, -2.84]),
    (Parameters::RBV, 61.0, 50.0, [0.59, -0.34, 0.53, -0.68, -0.70], [0.06, -0.29, 0.001, -1.16, -0.70]),
];

#[test]
fn a3_what_models_b_and_c_lose_without_noise() {
    for (machine, speed, period, b, c) in FLOORS {
        let (machine, h) = (machine.at(speed), 1e-6 * period);
        let delta = series(&machine, h).delta();
        let estimates = [model_b(&FirstOrderTheta::from(delta), h), model_c(&delta, h)];
        for (estimate, expected) in estimates.iter().zip([b, c]) {
            let errors = percent(estimate, &machine);
            let is_near = (0..5).all(|k| (errors[k] - expected[k]).abs() <= 0.01);
            assert!(is_near, "{speed} {period}: {errors:?}");
        }
    }
}

#[test]
fn a3_model_d_is_the_exact_inverse() {
    for (machine, h) in cases() {
        for (coefficients, bound) in
            [(machine.delta(h).current_voltage(), 1e-9), (series(&machine, h), 2e-7)]
        {
            let errors = percent(&model_d(&coefficients.delta(), h), &machine);
            let worst = errors.iter().fold(0.0f64, |worst, e| worst.max(1e-2 * e.abs()));
            assert!(worst < bound, "{machine:?} {h}: {worst:e}");
        }
        let r_s = dc_resistance(&machine.delta(h));
        assert!((r_s / machine.r_s - 1.0).norm() < 1e-9, "{r_s}");
    }
}

#[test]
fn a4_model_b_inverts_equation_32_and_c_takes_the_minus_root() {
    for (machine, h) in cases() {
        let Parameters { r_s, tau_r, sigma_l_s, l_s, omega_m } = machine;
        let x = (r_s + l_s / tau_r) * h / sigma_l_s;
        let theta = FirstOrderTheta {
            t1_minus_1: 1.0 - x,
            t2: -omega_m * h,
            t2_t4: -r_s * omega_m * h * h / sigma_l_s,
            t5: h / sigma_l_s,
            t5_t6: h * h / (sigma_l_s * tau_r),
        };
        let errors = percent(&model_b(&theta, h), &machine);
        assert!(errors.iter().all(|e| e.abs() < 1e-10), "{errors:?}");

        let delta = series(&machine, h).delta();
        let u = delta.u0 / delta.h1;
        let fd = delta.g0 + u * (Complex::ONE - delta.g1 - u);
        let [plus, minus] = time_constant_roots(u, fd, h).unwrap();
        let tau_r = model_c(&delta, h).tau_r.unwrap();
        assert!((tau_r / minus - 1.0).abs() < 1e-12);
        assert!((plus / h - 0.5).abs() < 0.1, "{}", plus / h);
    }
}

#[test]
fn what_cannot_be_identified_says_why() {
    let h = 50e-6;
    // Standstill: Models B and C divide by the speed; D does not.
    let still = Parameters::PX.at(0.0).delta(h);
    let b = model_b(&FirstOrderTheta::from(still), h);
    assert_eq!((b.r_s, b.omega_m), (Err(NotIdentifiable::NoSpeed), Ok(0.0)));
    let c = model_c(&still, h);
    assert_eq!((c.r_s, c.tau_r), (Err(NotIdentifiable::NoSpeed), Err(NotIdentifiable::NoSpeed)));
    assert!(c.sigma_l_s.is_ok());
    let d = model_d(&still, h).parameters().unwrap();
    assert!((d.tau_r / Parameters::PX.tau_r - 1.0).abs() < 1e-9);
    // All coefficients zero, no gain, not a number.
    let zero = Delta::from_array([Complex::ZERO; 4]);
    for estimate in [model_b(&zero.into(), h), model_c(&zero, h), model_d(&zero, h)] {
        assert!(estimate.array()[..4].iter().all(Result::is_err), "{estimate:?}");
    }
    let mut bad = still.array();
    bad[1].re = f64::NAN;
    let bad = Delta::from_array(bad);
    for estimate in [model_b(&bad.into(), h), model_c(&bad, h), model_d(&bad, h)] {
        assert!(estimate.array().iter().flatten().all(|x| x.is_finite()), "{estimate:?}");
    }
    // Signals without excitation: constant, zero, one sine, too short, not finite.
    let constant = |v: f64, i: f64| Data {
        v: vec![Complex::new(v, 0.3 * v); 500],
        i: vec![Complex::new(i, 0.2 * i); 500],
    };
    let sine: Vec<Complex> =
        (0..500).map(|k| Complex::from_polar(1.0, 0.1 * f64::from(k))).collect();
    let lagging = sine.iter().map(|v| v * Complex::new(0.4, -0.8)).collect();
    let sine = Data { v: sine, i: lagging };
    for data in [constant(1.0, 2.0), constant(0.0, 0.0), sine] {
        assert_eq!(data.regression().unwrap_err(), NotIdentifiable::PoorExcitation);
        assert!(data.first_order().is_err() && real_regression(&data).is_err());
    }
    let mut short = constant(1.0, 1.0);
    short.v.truncate(4);
    assert_eq!(short.regression().unwrap_err(), NotIdentifiable::TooFewSamples);
    let mut infinite = constant(1.0, 1.0);
    infinite.i[7].re = f64::INFINITY;
    assert_eq!(infinite.regression().unwrap_err(), NotIdentifiable::NotFinite);
}
