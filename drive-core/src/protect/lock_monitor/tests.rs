//! Tests of the lock monitor.

use super::*;

/// Returns a monitor with a nominal injection current of 0.26 A, 120 ms, and the sensitivity of a saliency `a` that is fixed to the
/// flux. `sign`: 1 with the injection across the flux, -1 along it.
fn monitor_of(a: f32, sign: f32) -> LockMonitor {
    let slope = SlopeTable::of_flux_saliency(Grid::REFERENCE, a);
    let mut monitor = LockMonitor {
        smoothing: 1.0 / (1.0 + 600.0 * 0.12),
        allowed: 0.55,
        moved: 0.03,
        least: 0.13 * 0.13,
        ..LockMonitor::default()
    };
    monitor.take(&CarrierTable::default(), &slope, sign);
    monitor
}

fn monitor() -> LockMonitor {
    monitor_of(-0.035, 1.0)
}

fn seen(carrier_a: f32, i_q: f32) -> Saliency {
    Saliency { q: 0.0, carrier_squared: carrier_a * carrier_a, i_q }
}

/// Returns a state with the baseline measured at 0.27 A.
fn ready(monitor: &LockMonitor) -> LockMonitorState {
    let mut state = LockMonitorState::default();
    for _ in 0..600 {
        assert_eq!(monitor.step(&mut state, &seen(0.27, 0.0), 1.0, true), Ok(()));
    }
    state
}

/// Runs steps until the fault. Returns their number and the fault.
fn until(monitor: &LockMonitor, state: &mut LockMonitorState, seen: Saliency) -> (u32, Fault) {
    for n in 1..=6000 {
        if let Err(fault) = monitor.step(state, &seen, 1.0, false) {
            return (n, fault);
        }
    }
    panic!("no fault")
}

#[test]
fn a_lost_flux_is_seen_in_the_time_the_mean_takes() {
    let monitor = monitor();
    for i_q in [0.0_f32, 0.6, -1.0, 3.0, -3.6] {
        let table = [(0.0, 1.0), (0.6, 1.0192), (1.0, 1.04167), (3.0, 1.14488), (3.6, 1.15781)];
        let ratio = table.iter().find(|p| p.0 == i_q.abs()).unwrap().1;
        let mut state = ready(&monitor);
        for _ in 0..600 {
            monitor.step(&mut state, &seen(0.27 * ratio, i_q), 1.0, false).unwrap();
        }
        assert!(state.loss.abs() < 0.02, "{i_q}: {}", state.loss);
        // Without flux the time is 120 ms ln(1 / 0.45) = 96 ms.
        let gone = seen(0.27 * ratio * (1.0 - 0.035), i_q);
        let (n, fault) = until(&monitor, &mut state, gone);
        assert_eq!(fault, Fault::LostLock);
        assert!((55..=61).contains(&n), "{i_q}: {n} injection periods");
    }
}

#[test]
fn too_much_flux_is_wrong_as_well_and_the_limit_depends_on_the_sign() {
    // The cases have a saliency, a lasting deficit, and the injection periods of 1/600 s until the fault with 120 ms: 72 ln(1 /
    // (1 - limit/deficit)).
    for ((a, loss, periods), sign) in [
        (-0.035, -1.0, Some(66.0)),
        (-0.035, -0.55, None),
        (0.035, -1.0, Some(25.7)),
        (0.035, -0.45, Some(79.0)),
        (0.035, 1.0, Some(57.5)),
        (0.035, 0.5, None),
    ]
    .into_iter()
    .flat_map(|case| [1.0, -1.0].map(|sign| (case, sign)))
    {
        let monitor = monitor_of(a, sign);
        let mut state = ready(&monitor);
        let wrong = seen(0.27 * libm::sqrtf(1.0 + 2.0 * sign * a * loss), 0.0);
        let tripped = (1..=6000).find(|_| monitor.step(&mut state, &wrong, 1.0, false).is_err());
        match (tripped, periods) {
            (None, None) => {}
            (Some(n), Some(expected)) => {
                assert!((f64::from(n) - expected).abs() < 3.0, "{a} {loss}: {n}");
            }
            other => panic!("{a} {loss}: {other:?}"),
        }
    }
}

#[test]
fn it_rests_while_the_current_moves_but_not_for_long() {
    let monitor = monitor();
    // If the flux is missing from a step of 1 A on, the fault comes 12 injection periods later than at rest.
    let mut state = ready(&monitor);
    let gone = |i_q| seen(0.27 * (1.0 - 0.035) * if i_q == 0.0 { 1.0 } else { 1.04167 }, i_q);
    let (n, _) = until(&monitor, &mut state, gone(1.0));
    assert!((67..=73).contains(&n), "{n} injection periods");
    // With a command that always changes, the deficit is judged at least 60 % of the time.
    let mut state = ready(&monitor);
    let n = (0..6000_u16)
        .find(|n| {
            let i_q = f32::from(n % 2);
            monitor.step(&mut state, &gone(i_q), 1.0, false).is_err()
        })
        .unwrap();
    assert!((92..=130).contains(&n), "{n} injection periods");
}

#[test]
fn a_smaller_carrier_on_purpose_is_no_loss() {
    let monitor = monitor();
    let mut state = ready(&monitor);
    for _ in 0..600 {
        monitor.step(&mut state, &seen(0.6 * 0.27, 0.0), 1.0 / 0.36, false).unwrap();
    }
    assert!(state.loss.abs() < 1e-3, "{}", state.loss);
}

#[test]
fn no_carrier_and_no_number_are_faults() {
    let monitor = monitor();
    let mut state = ready(&monitor);
    let mut result = Ok(());
    for n in 0..WEAK_PERIODS {
        assert_eq!(result, Ok(()), "{n}");
        result = monitor.step(&mut state, &seen(0.12, 0.0), 1.0, true);
    }
    assert_eq!(result, Err(Fault::CarrierWeak));
    // The cases are a number that is not finite, and a baseline that was never measured.
    for (mut state, carrier) in [
        (ready(&monitor), f32::NAN),
        (ready(&monitor), f32::INFINITY),
        (LockMonitorState::default(), 0.27),
    ] {
        let mut steps = (0..600).map(|_| monitor.step(&mut state, &seen(carrier, 0.0), 1.0, false));
        assert!(steps.any(|result| result == Err(Fault::LostLock)), "{carrier}");
    }
}

/// The baseline is the mean of the first 0.05 s, and after that the mean of the last 0.05 s.
#[test]
fn the_baseline_is_a_mean_of_the_last_carrier_periods() {
    let monitor = monitor();
    let mut state = LockMonitorState::default();
    for n in 0..MEASURED {
        assert!(!state.is_measured());
        monitor.step(&mut state, &seen(0.25 + 0.001 * f32::from(n % 2), 0.0), 1.0, true).unwrap();
        let mean = if n == 0 { 0.0625 } else { 0.0625 + 0.5 * (0.251 * 0.251 - 0.0625) };
        assert!((state.baseline - mean).abs() < 1e-4, "{n}: {}", state.baseline);
    }
    assert!(state.is_measured());
    for _ in 0..6 * u32::from(AVERAGED) {
        monitor.step(&mut state, &seen(0.28, 0.0), 1.0, true).unwrap();
    }
    assert!((state.baseline / (0.28 * 0.28) - 1.0).abs() < 1e-3, "{}", state.baseline);
}

#[test]
fn the_carrier_of_a_lost_flux_ends_the_lock() {
    let monitor = monitor();
    let mut state = LockMonitorState::default();
    let carrier = |a: f32| Saliency { q: 0.0, carrier_squared: a * a, i_q: 0.0 };
    for _ in 0..600 {
        monitor.step(&mut state, &carrier(0.26), 1.0, true).unwrap(); // baseline while magnetising
    }
    // Without flux the injection current falls by the saliency: 3.5 %.
    let gone = carrier(0.26 * (1.0 - 0.035));
    assert!(monitor.step(&mut state, &gone, 1.0, false).is_ok());
    let mut after = (0..90).map(|_| monitor.step(&mut state, &gone, 1.0, false));
    assert!(after.any(|result| result == Err(Fault::LostLock)));
}

/// The squared injection current beyond its mean is returned once, with its sign, whatever the unit of the deficit.
#[test]
fn a_current_beyond_its_mean_is_told_once() {
    for (sign, point) in [(1.0, 0), (-1.0, 8)] {
        let monitor = monitor_of(-0.035, sign);
        let mut state = ready(&monitor);
        let (i_q, ratio) = (monitor.grid.current(point), CarrierTable::default().points()[point]);
        for _ in 0..60 {
            monitor.step(&mut state, &seen(0.27 * ratio, i_q), 1.0, false).unwrap();
        }
        monitor.beyond(&mut state);
        assert_eq!(monitor.beyond(&mut state), 0.0);
        monitor.step(&mut state, &seen(0.27 * ratio * 1.005, i_q), 1.0, false).unwrap();
        let beyond = monitor.beyond(&mut state);
        assert!((beyond - 0.01).abs() < 5e-4, "{beyond}");
        assert_eq!(monitor.beyond(&mut state), 0.0);
    }
}
