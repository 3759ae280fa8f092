//! The learning on signals and voltages of given motors and sensors.
#![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
use super::*;
use core::f64::consts::TAU as TURN;

/// Carrier current at no torque current, A.
const CARRIER: f32 = 0.26;

/// Square of the carrier current, 5 % larger for every ampere.
fn carrier(i_q: f32) -> f32 {
    (CARRIER * (1.0 + 0.05 * i_q.abs())).powi(2)
}

fn learning() -> Learning {
    Learning::new(&Motor::default(), 0.7, 3.5)
}

/// Goes through all points with the signal that `q(i_q, theta)` gives and the voltage `v(i_q)`.
fn learn(q: impl Fn(f64, f64) -> f64, v: impl Fn(f32) -> Dq) -> (LearningAction, LearningState) {
    let (learning, mut state) = (learning(), LearningState::default());
    let (mut i_q, mut theta) = (0.0_f32, 0.25_f64);
    for _ in 0..3_000_000 {
        let step = i_q / (0.7 * 0.186) * PERIOD_S / TAU;
        theta += f64::from(step);
        let seen = (theta - f64::from(LAG) * f64::from(step)) * TURN;
        let signal = q(i_q.into(), seen) as f32;
        let angle = Angle::from_turns(theta as f32);
        let sample = LearningSample {
            signal,
            carrier_squared: carrier(i_q),
            theta: angle,
            flux_freq: step,
            voltage: v(i_q),
        };
        match learning.step(&mut state, &sample) {
            LearningAction::Current(next) => i_q = next,
            other => return (other, state),
        }
    }
    panic!("it does not end");
}

fn locked(i_q: f32) -> Dq {
    Dq::new(3.8 - 0.0515 * i_q * i_q / (0.7 * 0.186), 6.2 * i_q)
}

fn reference(i_q: f64) -> f64 {
    2.0 * 0.034 * 0.7 * i_q / i_q.hypot(0.7)
}

/// Signal that a gain difference of `mismatch` adds.
fn negative_sequence(mismatch: f64, theta: f64) -> f64 {
    let d = 0.5 * mismatch;
    d / 0.75_f64.sqrt() * ((2.0 * theta - TURN / 12.0).sin() - 0.5)
}

#[test]
fn splits_the_reference_from_the_mismatch() {
    for mismatch in [0.0, 0.01, -0.05] {
        let q = |i_q, theta: f64| reference(i_q) + negative_sequence(mismatch, theta);
        let (next, state) = learn(q, locked);
        assert_eq!(next, LearningAction::Done);
        let learned = learning().result(&state, true, 0.0, CARRIER * CARRIER);
        assert!(learned.accepted && learned.gain_mismatch.accepted, "{learned:?}");
        // A half turn ends within a period: 1/800 at the highest slip.
        assert!((f64::from(learned.gain_mismatch.value) - mismatch).abs() < 1e-4);
        assert!((learned.current_saliency.value - 0.034).abs() < 1e-4);
        let ratios = learned.carrier.unwrap();
        assert!((ratios.points()[8] - 1.1).abs() < 1e-4, "{:?}", ratios.points());
        for n in 1..=learned.points {
            let i_q = 0.25 * n as f32;
            let difference = f64::from(learned.reference.at(i_q)) - reference(i_q.into());
            assert!(difference.abs() < 1e-4, "{i_q} A: {difference}");
        }
    }
}

#[test]
fn what_does_not_fit_is_not_accepted() {
    let result = |q: &dyn Fn(f64, f64) -> f64| {
        learning().result(&learn(q, locked).1, true, 0.0, CARRIER * CARRIER)
    };
    // A negative sequence that no gain makes, and a mismatch that no sensor has.
    let learned = result(&|i_q, theta| reference(i_q) + 0.005 * (2.0 * theta + 1.05).sin());
    assert!(learned.accepted && !learned.gain_mismatch.accepted, "{learned:?}");
    let learned = result(&|i_q, theta| reference(i_q) + negative_sequence(0.2, theta));
    assert!(!learned.gain_mismatch.accepted, "{learned:?}");
    // A reference that is not odd, too large, or not a number.
    for q in [0.01, 1.0, f64::NAN] {
        assert!(!result(&|i_q, _| reference(i_q) + q).accepted, "{q}");
    }
    assert!(!result(&|i_q, _| 0.2 * i_q).accepted);
    // A saliency that does not follow the law of the current.
    let learned = result(&|i_q: f64, _| 0.02 * (4.0 * i_q).sin());
    assert!(learned.accepted && !learned.current_saliency.accepted, "{learned:?}");
}

#[test]
fn a_moving_shaft_is_noticed() {
    let q = |i_q, _| reference(i_q);
    let turned = |i_q| locked(i_q) + Dq::new(0.0, 0.6);
    let free = |i_q: f32| locked(i_q) - Dq::new(0.153 * i_q * i_q / (0.7 * 0.186), 0.0);
    assert_eq!(learn(q, turned).0, LearningAction::Moved);
    assert_eq!(learn(q, free).0, LearningAction::Moved);
}

#[test]
fn a_flux_that_does_not_turn_ends_it() {
    let (learning, mut state) = (learning(), LearningState::default());
    let nothing = LearningSample {
        signal: 0.0,
        carrier_squared: 0.0,
        theta: Angle::ZERO,
        flux_freq: 0.0,
        voltage: Dq::ZERO,
    };
    let stuck = (0..200_000).any(|_| learning.step(&mut state, &nothing) == LearningAction::Stuck);
    assert!(stuck);
}

fn found() -> Learned {
    Learned {
        reference: ReferenceTable::default(),
        carrier: None,
        points: 13,
        asymmetry: 0.001,
        gain_mismatch: Fitted { value: 0.01, misfit: 0.0, accepted: true },
        current_saliency: Fitted { value: 0.03, misfit: 0.02, accepted: true },
        flux_saliency: -0.035,
        accepted: true,
    }
}

#[test]
fn a_second_learning_adds_to_the_gains_and_keeps_what_it_does_not_find() {
    let first = found();
    assert_eq!(first.on_top_of(None), first);
    let mut second = found();
    second.gain_mismatch.value = -0.002;
    second.current_saliency.accepted = false;
    let both = second.on_top_of(Some(&first));
    assert!((both.gain_mismatch.value - 0.008).abs() < 1e-6);
    assert_eq!(both.current_saliency, first.current_saliency);
    second.gain_mismatch.accepted = false;
    assert_eq!(second.on_top_of(Some(&first)).gain_mismatch, first.gain_mismatch);
}

#[test]
fn what_no_learning_can_have_found_is_not_believed() {
    assert!(found().is_believable());
    let spoilt: [fn(&mut Learned); 7] = [
        |l| l.accepted = false,
        |l| l.asymmetry = f32::NAN,
        |l| l.points = 0,
        |l| l.points = 16,
        |l| l.gain_mismatch.value = 0.2,
        |l| l.gain_mismatch.misfit = f32::INFINITY,
        |l| l.current_saliency.value = -0.4,
    ];
    for spoil in spoilt {
        let mut learned = found();
        spoil(&mut learned);
        assert!(!learned.is_believable(), "{learned:?}");
    }
}
