//! Model S: the speed, the parameters beside Model C, and starts far from the machine (S1).

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use sim_lab::identification::models::{NotIdentifiable, model_c};
use sim_lab::identification::structured::{fit_from, model_s, starts};
use sim_lab::identification::trial::Noise;
use sim_lab::identification::{Complex, Estimate, Parameters, Signal, Trial};

const PERIODS: [f64; 3] = [50e-6, 100e-6, 200e-6];
const TRIALS: u64 = 20;

/// Mean of the absolute errors in %.
fn errors(machine: Parameters, signal: Signal, h: f64) -> [[f64; 5]; 2] {
    let trial = Trial::printed(machine, signal, h, Noise::HALF);
    let truth = machine.array();
    let mut sums = [[0.0; 5]; 2];
    for m in 0..TRIALS {
        let regression = trial.run(1, m).regression().expect("excited");
        let fit = model_s(&regression, h).expect("converges");
        let estimates = [model_c(&regression.delta, h), Estimate::from(fit.parameters)];
        for (sums, estimate) in sums.iter_mut().zip(estimates) {
            for (k, value) in estimate.array().into_iter().enumerate() {
                let error = value.map_or(100.0, |value| 100.0 * (value / truth[k] - 1.0));
                sums[k] += error.abs() / TRIALS as f64;
            }
        }
    }
    sums
}

#[test]
fn s1_speed_below_half_a_percent_and_better_than_c_on_every_parameter() {
    let mut means = [[0.0; 5]; 2];
    for signal in Signal::ALL {
        for speed in [375.0, 61.0] {
            for h in PERIODS {
                let sums = errors(Parameters::PX.at(speed), signal, h);
                for (mean, sum) in means.iter_mut().flatten().zip(sums.iter().flatten()) {
                    *mean += sum / 12.0;
                }
                if signal == Signal::Schroeder {
                    assert!(sums[1][4] < 0.5, "{speed} {h}: {:?}", sums[1]);
                }
            }
        }
    }
    for (c, s) in means[0].iter().zip(means[1]) {
        assert!(s < *c, "{means:?}");
    }
}

#[test]
fn s1_starts_a_factor_five_off() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let (mut converged, mut none) = (0, 0);
    for trial in 0..500u64 {
        let signal = Signal::ALL[trial as usize % 2];
        let machine = Parameters::PX.at([375.0, 61.0][trial as usize / 2 % 2]);
        let h = PERIODS[trial as usize / 4 % 3];
        let data = Trial::printed(machine, signal, h, Noise::HALF);
        let regression = data.run(2, trial).regression().expect("excited");
        // Each parameter is five times too large or too small, and l_s is above sigma_l_s.
        let mut off = |x: f64| if rng.random::<bool>() { 5.0 * x } else { 0.2 * x };
        let sigma_l_s = off(machine.sigma_l_s);
        let start = Parameters {
            r_s: off(machine.r_s),
            tau_r: off(machine.tau_r),
            sigma_l_s,
            l_s: sigma_l_s + off(machine.l_s - machine.sigma_l_s),
            omega_m: off(machine.omega_m),
        };
        // If the noise makes the best r_s negative, there is no machine to find.
        let Ok(best) = model_s(&regression, h) else {
            assert!(signal == Signal::SixStep && fit_from(&regression, h, &start).is_err());
            none += 1;
            continue;
        };
        match fit_from(&regression, h, &start) {
            Err(reason) => assert_eq!(reason, NotIdentifiable::NotConverged),
            Ok(fit) => {
                let is_best = fit.cost <= best.cost * (1.0 + 1e-6) + 1e-20;
                assert!(is_best, "{trial}: {:e} {:e} {:?}", fit.cost, best.cost, fit.parameters);
                converged += 1;
            }
        }
    }
    assert!(none <= 5 && converged >= 470, "{converged} converged, {none} none");
}

#[test]
fn clean_data_give_the_machine_and_standstill_is_no_exception() {
    for speed in [375.0, 61.0, 0.0, -100.0] {
        let machine = Parameters::PX.at(speed);
        let trial = Trial::printed(machine, Signal::Schroeder, 100e-6, Noise::NONE);
        let regression = trial.run(1, 0).regression().expect("excited");
        let fit = model_s(&regression, 100e-6).expect("converges").parameters;
        for (found, truth) in fit.array()[..4].iter().zip(machine.array()) {
            assert!((found / truth - 1.0).abs() < 1e-6, "{fit:?}");
        }
        assert!((fit.omega_m - speed).abs() < 1e-4, "{fit:?}");
    }
}

#[test]
fn nonsense_is_reported() {
    let trial = Trial::printed(Parameters::PX, Signal::Schroeder, 100e-6, Noise::NONE);
    let mut regression = trial.run(1, 0).regression().expect("excited");
    let bad = Parameters { r_s: f64::NAN, ..Parameters::PX };
    assert!(fit_from(&regression, 100e-6, &bad).is_err());
    assert!(fit_from(&regression, 100e-6, &Parameters { r_s: -1.0, ..Parameters::PX }).is_err());
    regression.delta.g0 = Complex::new(f64::NAN, 0.0);
    assert_eq!(model_s(&regression, 100e-6).unwrap_err(), NotIdentifiable::NotConverged);
    regression.delta.h1 = Complex::ZERO;
    assert!(starts(&regression.delta, 100e-6).is_empty());
}
