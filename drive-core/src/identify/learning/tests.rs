//! Tests of the self-commissioning on signals and voltages of given motors and sensors.
#![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
use super::*;
use crate::carrier::Asymmetry;
use crate::settings::design::learning::plan;
use crate::table::{ReferenceTable, SlopeTable};
use crate::{Motor, UnitVector};
use core::f64::consts::TAU as TURN;

/// Injection current without q-axis current, A.
const CARRIER: f32 = 0.26;

/// Returns the square of the injection current, which is 5 % larger for every ampere.
fn carrier(i_q: f32) -> f32 {
    (CARRIER * (1.0 + 0.05 * i_q.abs())).powi(2)
}

fn learning() -> Learning {
    plan(&Motor::default(), 0.7, 3.5, Grid::REFERENCE, Some(1.0))
}

/// Returns the measurements before the points: no check, and the injection current without q-axis current.
fn start() -> Start {
    let axis = UnitVector { cos: 0.0, sin: 1.0 };
    Start { looked: None, per_looked: 0.0, baseline: CARRIER * CARRIER, at_start: None, axis }
}

/// Runs through all points with the signal `q(i_q, lead, theta)` and the voltage `v(i_q)`. If the self-commissioning ends, each
/// point must have lasted as long as expected.
fn learn(
    q: impl Fn(f64, f64, f64) -> f64,
    v: impl Fn(f32) -> Dq,
) -> (Result<(), Fault>, LearningState) {
    learn_with(&learning(), q, v)
}

fn learn_with(
    learning: &Learning,
    q: impl Fn(f64, f64, f64) -> f64,
    v: impl Fn(f32) -> Dq,
) -> (Result<(), Fault>, LearningState) {
    let mut state = LearningState::default();
    let (mut point, mut theta) = (Operate { i_q: 0.0, lead: 0.0 }, 0.25_f64);
    let mut begun = vec![];
    for n in 0..3_000_000 {
        if begun.len() == state.point {
            begun.push(n);
        }
        let (sin, cos) = point.lead.sin_cos();
        let (i_d, i_q) = (0.7 * cos + point.i_q * sin, point.i_q * cos - 0.7 * sin);
        let step = i_q / (i_d * 0.186) * PERIOD_S / TAU;
        theta += f64::from(step);
        let seen = (theta - f64::from(LAG) * f64::from(step)) * TURN;
        let sample = LearningSample {
            signal: q(point.i_q.into(), point.lead.into(), seen) as f32,
            carrier_squared: carrier(point.i_q),
            theta: Angle::from_turns(theta as f32),
            flux_freq: step,
            voltage: v(point.i_q),
        };
        match learning.step(&mut state, &sample) {
            Ok(Some(next)) => point = next,
            Ok(None) => {
                for (number, begun) in begun.into_iter().enumerate() {
                    let (left, expected) = ((n - begun) as f32, learning.seconds_left(number + 1));
                    let off = left * PERIOD_S - expected;
                    assert!(off.abs() < 0.03 * expected + 0.01, "{number}: {expected} s, {off}");
                }
                return (Ok(()), state);
            }
            Err(fault) => return (Err(fault), state),
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

/// Returns a sensitivity that falls by a tenth for every ampere.
fn slope(i_q: f64) -> f64 {
    -0.07 * (1.0 - 0.1 * i_q.abs())
}

/// Returns the signal of a motor with that offset and sensitivity.
fn sound(i_q: f64, lead: f64, _: f64) -> f64 {
    reference(i_q) + slope(i_q) * lead
}

/// Returns the signal that a gain difference of `mismatch` adds.
fn negative_sequence(mismatch: f64, theta: f64) -> f64 {
    let d = 0.5 * mismatch;
    d / 0.75_f64.sqrt() * ((2.0 * theta - TURN / 12.0).sin() - 0.5)
}

#[test]
fn splits_the_reference_from_slope_and_mismatch() {
    for mismatch in [0.0, 0.01, -0.05] {
        let q = |i_q, lead, theta| sound(i_q, lead, theta) + negative_sequence(mismatch, theta);
        let (next, state) = learn(q, locked);
        assert_eq!(next, Ok(()));
        // With the axis at 90° the measured injection current of a is smaller.
        let baseline = CARRIER * CARRIER * (1.0 - mismatch as f32);
        let learned = learning().result(&state, &Start { baseline, ..start() });
        assert_eq!(learned.verdict, Verdict::Sound);
        assert!(learned.gain_mismatch.accepted, "{learned:?}");
        // A half turn ends within a period, which is 1/800 at the highest slip.
        assert!((f64::from(learned.gain_mismatch.value) - mismatch).abs() < 2e-4, "{learned:?}");
        assert!(learned.asymmetry.size() < 2e-4, "{learned:?}");
        assert!((learned.current_saliency.value - 0.034).abs() < 1e-4);
        let ratios = learned.carrier.unwrap();
        assert!((ratios.points()[8] - 1.1).abs() < 2e-3, "{:?}", ratios.points());
        for n in 1..=learned.points {
            let i_q = 0.25 * n as f32;
            let difference = f64::from(learned.reference.at(i_q)) - reference(i_q.into());
            assert!(difference.abs() < 1e-4, "{i_q} A: {difference}");
            let k = f64::from(learned.slope.unwrap().points()[n]);
            assert!((k - slope(i_q.into())).abs() < 1e-3, "{i_q} A: {k}");
        }
        assert_eq!(learned.limit_a, 3.25, "to the last point");
    }
}

/// Along the flux the saliency has the opposite sign, the signal of the sensors has not, and the baseline is measured on phase a.
#[test]
fn along_the_flux_the_same_is_learned() {
    let q = |i_q, lead, theta| negative_sequence(0.01, theta) - sound(i_q, lead, theta);
    let learning = plan(&Motor::default(), 0.7, 3.5, Grid::REFERENCE, Some(-1.0));
    let (next, state) = learn_with(&learning, q, locked);
    assert_eq!(next, Ok(()));
    let (baseline, axis) = (CARRIER * CARRIER * 1.01, UnitVector { cos: 1.0, sin: 0.0 });
    let learned = learning.result(&state, &Start { baseline, axis, ..start() });
    assert_eq!(learned.verdict, Verdict::Sound);
    assert!((learned.gain_mismatch.value - 0.01).abs() < 2e-4, "{learned:?}");
    assert!((learned.current_saliency.value - 0.034).abs() < 1e-4, "{learned:?}");
    assert!((learned.slope_at_rest + 0.07).abs() < 1e-3, "{learned:?}");
    let ratios = learned.carrier.unwrap();
    assert!((ratios.points()[8] - 1.1).abs() < 2e-3, "{:?}", ratios.points());
}

#[test]
fn an_asymmetry_that_no_gain_makes_is_taken_out_as_what_it_is() {
    let learned = |q: &dyn Fn(f64) -> f64| {
        let q = |i_q, lead, theta| sound(i_q, lead, theta) + q(theta);
        learning().result(&learn(q, locked).1, &start())
    };
    // Cross-talk of 2 % from b to a turns everything by 0.66°, which appears as 0.0115 in the signal; see the asymmetry.
    let found = learned(&|theta: f64| 0.0115 + 0.0115 * (2.0 * theta + 1.05).sin());
    assert!(found.verdict == Verdict::Sound && !found.gain_mismatch.accepted, "{found:?}");
    let [sin, cos] = [1.05_f32.cos(), 1.05_f32.sin()].map(|x| 0.0115 * x);
    let difference = Asymmetry { constant: 0.0115, sin, cos }.plus(&found.asymmetry, -1.0);
    assert!(difference.size() < 2e-4, "{found:?}");
    // No sensor has such a large mismatch.
    let found = learned(&|theta| negative_sequence(0.2, theta));
    assert!(!found.gain_mismatch.accepted, "{found:?}");
    // The constant is larger than sensors can cause.
    assert_eq!(learned(&|_| 0.11).verdict, Verdict::OutOfRange);
}

#[test]
fn the_slope_decides_what_is_accepted_and_how_far() {
    let learned = |k: &dyn Fn(f64, f64) -> f64| {
        let q = |i_q, lead: f64, _| reference(i_q) + k(i_q, lead);
        learning().result(&learn(q, locked).1, &start())
    };
    for (k, verdict) in [
        (-0.031, Verdict::Sound),
        (-0.029, Verdict::Weak),
        (-0.0195, Verdict::SlopeTooSmall),
        (0.054, Verdict::Sound),
        (0.05, Verdict::Weak),
        (0.034, Verdict::SlopeTooSmall),
        (0.0, Verdict::SlopeTooSmall),
        (f64::NAN, Verdict::OutOfRange),
    ] {
        let found = learned(&|_, lead| k * lead);
        assert_eq!(found.verdict, verdict, "{k}");
        assert_eq!(found.slope.is_some(), verdict.is_accepted(), "{k}");
    }
    // The sensitivity vanishes above a current, on one side only.
    let lost = |from: f64| {
        move |i_q: f64, lead: f64| {
            if i_q.abs() > from && i_q * lead > 0.0 { 0.0 } else { -0.05 * lead }
        }
    };
    let found = learned(&lost(1.6));
    assert_eq!((found.verdict, found.limit_a), (Verdict::Sound, 1.5));
    let k = *found.slope.unwrap().points();
    // The value is interpolated: half of one side has vanished between 1.25 and 1.75 A.
    assert!(k[6..].iter().all(|k| (k + 0.0375).abs() < 1e-3), "held beyond the limit: {k:?}");
    let found = learned(&lost(0.6));
    assert_eq!((found.verdict, found.limit_a), (Verdict::LimitTooLow, 0.5));
    let text = found.to_string();
    assert!(text.contains("lost above 0.50 A") && text.contains("-0.05"), "{text}");
}

#[test]
fn what_does_not_fit_is_not_accepted() {
    let result = |q: &dyn Fn(f64) -> f64| {
        let q = |i_q, lead, _| q(i_q) + slope(i_q) * lead;
        learning().result(&learn(q, locked).1, &start())
    };
    // These offsets are too large, NaN, or even by a part that differs between the currents.
    assert_eq!(result(&|i_q| 0.2 * i_q).verdict, Verdict::OutOfRange);
    assert!(!result(&|_| f64::NAN).verdict.is_accepted());
    let uneven = result(&|i_q| reference(i_q) + 0.002 * i_q * i_q);
    assert_eq!(uneven.verdict, Verdict::Uneven, "{uneven:?}");
    // The offset is uneven and the sensitivity too small. The verdict is the sensitivity, which a better lock of the shaft does not
    // raise.
    let q = |i_q, lead, _| reference(i_q) + 0.002 * i_q * i_q + 0.1 * slope(i_q) * lead;
    let both = learning().result(&learn(q, locked).1, &start());
    assert_eq!(both.verdict, Verdict::SlopeTooSmall, "{both:?}");
    // With a sensor that is not linear, the signal repeats four times in a turn, here at large currents.
    let bent = |size: f64| {
        let q = |i_q: f64, lead: f64, theta: f64| {
            let at = if i_q > 2.0 { size } else { 0.0 };
            reference(i_q) + slope(i_q) * lead + at * (4.0 * theta + 0.3).sin()
        };
        learning().result(&learn(q, locked).1, &start())
    };
    let k = slope(0.0).abs();
    let (sound, found) = (bent(0.14 * k), bent(0.16 * k));
    assert!(sound.verdict.is_accepted() && found.verdict == Verdict::Bent, "{sound:?} {found:?}");
    assert!((f64::from(found.ripple) / (0.16 * k) - 1.0).abs() < 0.01, "{}", found.ripple);
    let text = found.to_string();
    assert!(text.contains("four times") && text.contains("not linear"), "{text}");
    // A smaller part is accepted, and reported above a third of the limit.
    let told = |size: f64| bent(size * k).to_string().contains("not quite linear");
    assert!(told(0.055) && !told(0.045));
    // This saliency does not follow the law of the current.
    let learned = result(&|i_q: f64| 0.02 * (4.0 * i_q).sin());
    assert!(learned.verdict.is_accepted() && !learned.current_saliency.accepted, "{learned:?}");
}

/// The lead is chosen so that the flux slips at every point, by at least half a step of the table. A grid up to the largest q-axis
/// current has all its points.
#[test]
fn the_flux_turns_at_every_point() {
    let currents =
        [(0.7, 3.5), (2.0, 3.5), (2.5, 3.5), (12.0, 70.0), (0.05, 3.5), (3.15_f32, 6.049)];
    let left = |(i_d, largest): (f32, f32)| (largest * largest - i_d * i_d).sqrt();
    let all = |at: (f32, f32)| [(at, at.1), (at, left(at))];
    for ((i_d, largest), end) in currents.into_iter().flat_map(all) {
        let grid = Grid::for_current(end);
        let learning = plan(&Motor::default(), i_d, largest, grid, Some(1.0));
        assert!(end == largest || learning.points == 14, "{i_d}: {}", learning.points);
        let tan = learning.lead.tan();
        assert!((0.099..0.3).contains(&tan), "{i_d}: {tan}");
        let (mut seen, mut magnetising, mut previous) = ([[0; POINTS]; 3], i_d, None);
        for number in 0..learning.points() {
            let point = learning.point(number);
            let Operate { i_q, lead } = learning.operate(point);
            let slipping = i_q * lead.cos() - i_d * lead.sin();
            let least = f32::min(0.48 * learning.grid.step_a(), 0.19 * i_d);
            assert!(slipping.abs() > least, "{i_d}: {point:?}");
            seen[point.lead][point.n] += 1;
            if let (true, Some(first)) = (point.mirrored, previous) {
                assert_eq!((i_q, lead), first, "{point:?}");
            }
            previous = Some((-i_q, -lead));
            // This is the rest of the change of the flux after the settling.
            let now = i_d * lead.cos() + i_q * lead.sin();
            let left = (now - magnetising) * (-point.settle_s / learning.tau_r).exp();
            assert!(left.abs() < 0.021 * i_d, "{point:?}: {left}");
            magnetising = now;
        }
        let without: Vec<usize> = (1..=learning.points).collect();
        let of = |lead: usize| (0..POINTS).filter(move |&n| seen[lead][n] == 2);
        assert!(of(0).eq(without), "every current: {seen:?}");
        let led: Vec<usize> = (1..=learning.points).rev().step_by(2).collect();
        assert!(of(2).eq(led.iter().rev().copied()), "every other: {seen:?}");
        assert!(of(1).eq([0].into_iter().chain(led.into_iter().rev())), "{seen:?}");
    }
    // A current difference has no sensitivity.
    let learning = plan(&Motor::default(), 0.7, 3.5, Grid::REFERENCE, None);
    assert_eq!(learning.points(), 26);
}

#[test]
fn a_moving_shaft_is_noticed() {
    let q = sound;
    // The limits are 0.5 V, and half of the voltage of a free shaft.
    let turned = |v: f32| move |i_q| locked(i_q) + Dq::new(0.0, v);
    let free = |share: f32| {
        move |i_q: f32| locked(i_q) - Dq::new(share * 0.153 * i_q * i_q / (0.7 * 0.186), 0.0)
    };
    for (ended, _) in [learn(q, turned(-0.48)), learn(q, free(0.45)), learn(q, free(-0.6))] {
        assert_eq!(ended, Ok(()));
    }
    for (ended, state) in [learn(q, turned(-0.52)), learn(q, turned(0.52)), learn(q, free(0.55))] {
        assert_eq!(ended, Err(Fault::ShaftNotLocked));
        // A point was evaluated, so the run did not end because of its length.
        assert_eq!(state.sums.count, 0);
    }
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
    let ended = (0..200_000).find_map(|_| learning.step(&mut state, &nothing).err());
    assert_eq!(ended, Some(Fault::ShaftNotLocked));
    assert!(state.sums.count > learning.longest, "by its length, not by a shaft that moved");
}

fn found() -> Learned {
    Learned {
        reference: ReferenceTable::default(),
        slope: Some(SlopeTable::of_flux_saliency(Grid::REFERENCE, -0.03)),
        slope_at_rest: -0.06,
        limit_a: 2.75,
        carrier: None,
        points: 13,
        spread: 0.001,
        ripple: 0.0,
        asymmetry: Asymmetry { constant: 0.001, sin: 0.002, cos: -0.003 },
        at_start: Some(Asymmetry { constant: 0.001, sin: 0.0, cos: 0.001 }),
        positions: 1,
        gain_mismatch: Fitted { value: 0.01, misfit: 0.0, accepted: true },
        current_saliency: Fitted { value: 0.03, misfit: 0.02, accepted: true },
        flux_saliency: -0.035,
        verdict: Verdict::Sound,
    }
}

#[test]
fn a_second_learning_adds_to_the_gains_and_keeps_what_it_does_not_find() {
    let first = found();
    let mut second = found();
    second.gain_mismatch.value = -0.002;
    second.current_saliency.accepted = false;
    second.asymmetry = Asymmetry { constant: 0.002, sin: -0.004, cos: 0.0 };
    // The second result is the rest after the correction by the first, and half of it counts.
    let both = second.on_top_of(&first);
    assert!((both.gain_mismatch.value - 0.009).abs() < 1e-6);
    let off = both.asymmetry.plus(&Asymmetry { constant: 0.002, sin: 0.0, cos: -0.003 }, -1.0);
    assert!(off.size() < 1e-7 && both.positions == 2, "{both:?}");
    // At its start, 0.001 each of constant and cosine were measured beyond the whole result, and half of the result is not
    // subtracted.
    let seen = second.gain_mismatch.with(&second.asymmetry).plus(&both.at_start.unwrap(), -2.0);
    let off = seen.plus(&Asymmetry { constant: 0.001, sin: 0.0, cos: 0.001 }, 2.0);
    assert!(off.size() < 1e-7, "{both:?}");
    // A third result of zero changes nothing.
    second.gain_mismatch.value = 0.0;
    second.asymmetry = Asymmetry::default();
    let third = second.on_top_of(&both);
    assert_eq!(
        (third.asymmetry, third.gain_mismatch.value),
        (both.asymmetry, both.gain_mismatch.value)
    );
    assert_eq!(third.positions, 3);
    assert_eq!(both.current_saliency, first.current_saliency);
    second.gain_mismatch.accepted = false;
    assert_eq!(second.on_top_of(&first).gain_mismatch, first.gain_mismatch);
}

#[test]
fn what_no_learning_can_have_found_is_not_believed() {
    assert!(found().is_believable());
    let spoilt: [fn(&mut Learned); 14] = [
        |l| l.verdict = Verdict::SlopeTooSmall,
        |l| l.spread = f32::NAN,
        |l| l.asymmetry.sin = f32::NAN,
        |l| l.at_start.as_mut().unwrap().cos = 0.2,
        |l| l.at_start.as_mut().unwrap().sin = f32::NAN,
        |l| l.slope_at_rest = -0.05,
        |l| l.slope = None,
        |l| l.limit_a = 0.9,
        |l| l.limit_a = f32::NAN,
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
