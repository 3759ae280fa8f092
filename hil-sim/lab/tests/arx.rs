//! The general ARX fit of appendix A (Barroso 2017).

use sim_lab::identification::NotIdentifiable;
use sim_lab::identification::arx::{Orders, fit};
use sim_lab::identification::signals::Prbs;

/// The plant of Eq. 3.34, A per V.
const P: f64 = 0.93916;
const K: f64 = 0.004_053_2;

fn output(u: &[f64]) -> Vec<f64> {
    let mut y = 0.0;
    let step = |u: &f64| {
        let before = y;
        y = P * y + K * u;
        before
    };
    u.iter().map(step).collect()
}

fn prbs() -> Vec<f64> {
    let mut prbs = Prbs::default();
    (0..4 * 255).map(|_| 30.0 * prbs.step()).collect()
}

const FIRST: Orders = Orders { outputs: 1, inputs: 1, delay: 0 };

#[test]
fn a_clean_sequence_gives_the_plant() {
    let u = prbs();
    let found = fit(&u, &output(&u), FIRST).unwrap();
    assert!((found.a[0] + P).abs() < 1e-13 && (found.b[0] - K).abs() < 1e-14, "{found:?}");
    // Quantised like the current sensors of the source: 2.2 mA.
    let quantised: Vec<f64> = output(&u).iter().map(|y| (y / 0.0022).round() * 0.0022).collect();
    let found = fit(&u, &quantised, FIRST).unwrap();
    let [pole, gain] = [found.a[0] + P, found.b[0] / K - 1.0];
    assert!(pole.abs() < 9e-5 && gain.abs() < 1.2e-3 && found.rms < 0.0022, "{found:?}");
}

#[test]
fn higher_orders_and_delay() {
    let u = prbs();
    let mut y = vec![0.0; u.len()];
    for k in 4..u.len() {
        y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + 0.2 * u[k - 3] - 0.1 * u[k - 4];
    }
    let found = fit(&u, &y, Orders { outputs: 2, inputs: 2, delay: 2 }).unwrap();
    let all: Vec<f64> = [&found.a[..], &found.b[..]].concat();
    for (found, expected) in all.iter().zip([-1.5, 0.7, 0.2, -0.1]) {
        assert!((found - expected).abs() < 1e-12, "{all:?}");
    }
    // One order too many: the regression is singular, which the condition number shows.
    let many = fit(&u, &y, Orders { outputs: 3, inputs: 3, delay: 2 });
    assert_eq!(many, Err(NotIdentifiable::PoorExcitation));
}

#[test]
fn what_does_not_excite_is_refused() {
    let constant = vec![10.0; 500];
    let settled = vec![10.0 * K / (1.0 - P); 500];
    assert_eq!(fit(&constant, &settled, FIRST), Err(NotIdentifiable::PoorExcitation));
    assert_eq!(fit(&[0.0; 50], &[0.0; 50], FIRST), Err(NotIdentifiable::PoorExcitation));
    assert_eq!(fit(&[1.0], &[1.0], FIRST), Err(NotIdentifiable::TooFewSamples));
    assert_eq!(fit(&[], &[], FIRST), Err(NotIdentifiable::TooFewSamples));
    let u = prbs();
    let mut y = output(&u);
    y[100] = f64::NAN;
    assert_eq!(fit(&u, &y, FIRST), Err(NotIdentifiable::NotFinite));
}
