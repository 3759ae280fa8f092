//! Tests of the PI controller against Appendix B and section 3.8.

use super::*;
use proptest::prelude::*;

/// The loop of Figure 40: an integrator y += sat(u, 0.15) with K_c = 0.25, z_c = 0.1, and a unit step.
#[derive(Debug)]
struct Figure40 {
    y_max: f32,
    u_max: f32,
    u_at_crossing: f32,
    saturated: usize,
}

fn figure_40(anti_windup: bool) -> Figure40 {
    let pi = Pi { k_c: 0.25, z_c: 0.1 };
    let mut state = PiState::default();
    let mut y = 0.0f32;
    let mut r = Figure40 { y_max: 0.0, u_max: 0.0, u_at_crossing: f32::NAN, saturated: 0 };
    for _ in 0..200 {
        let u = pi.step(&mut state, 1.0 - y);
        let applied = u.clamp(-0.15, 0.15);
        if anti_windup {
            state.back_calculate(applied - u);
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
    let near = |found: f32, expected: f32| (found - expected).abs() < 1e-3;
    assert!(near(without.y_max, 2.005) && near(without.u_max, 0.869), "{without:?}");
    assert!(near(without.u_at_crossing, 0.854) && without.saturated == 153, "{without:?}");
    assert!(near(with.y_max, 1.301) && with.saturated == 7, "{with:?}");
}

/// Runs the unit step of Eq. 3.39 on k/(z - p). Returns the overshoot in %, and the sample from
/// which on the response stays within 2 %.
fn step_of_3_39(p: f32, filtered: bool) -> (f32, usize) {
    let pi = Pi { k_c: 52.48, z_c: 0.94786 };
    let (mut state, mut reference) = (PiState::default(), ReferenceState::default());
    let (mut y, mut peak, mut outside) = (0.0f32, 0.0f32, 0);
    for k in 0..2000 {
        if (y - 1.0).abs() > 0.02 {
            outside = k + 1;
        }
        let r = if filtered { pi.filter(&mut reference, 0.0, 1.0) } else { 1.0 };
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
    assert!(nominal.0 < 1e-3 && nominal.1 == 25, "{nominal:?}");
    assert!(filtered.0 < 1e-3 && filtered.1.abs_diff(82) <= 1, "{filtered:?}");
    assert!((slow.0 - 4.27).abs() < 0.01, "{slow:?}");
    assert!(slow_filtered.0 < 1e-3, "{slow_filtered:?}");
}

#[test]
fn reference_filter_is_3_40() {
    let (pi, mut state) = (Pi { k_c: 1.0, z_c: 0.75 }, ReferenceState::default());
    // (1 - p)/(z - p): 0, 1 - p, (1 - p) p, ...
    let h = [1.0, 0.0, 0.0, 0.0].map(|x| pi.filter(&mut state, 0.0, x));
    assert_eq!(h, [0.0, 0.25, 0.1875, 0.140_625]);
}

#[test]
fn the_integrator_stops_below_the_stated_error() {
    let pi = Pi { k_c: 55.3, z_c: 0.9538 };
    let moves = |e: f32| {
        let mut state = PiState::default();
        pi.step(&mut state, e);
        state.back_calculate(180.0 - state.output);
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
        let mut both = DqPiState::default();
        let (mut d, mut q) = (PiState::default(), PiState::default());
        for (e_d, e_q) in errors {
            let u = pi.step(&mut both, Dq::new(e_d, e_q));
            let (u_d, u_q) = (pi.d.step(&mut d, e_d), pi.q.step(&mut q, e_q));
            prop_assert_eq!((u.d.to_bits(), u.q.to_bits()), (u_d.to_bits(), u_q.to_bits()));
            let applied = Dq::new(u_d.clamp(-limit, limit), u_q.clamp(-limit, limit));
            both.back_calculate(applied - u);
            d.back_calculate(applied.d - u_d);
            q.back_calculate(applied.q - u_q);
            prop_assert_eq!(Dq::new(both.d.output, both.q.output), Dq::new(d.output, q.output));
            // The output never winds up beyond the limit, except for rounding.
            prop_assert!(d.output.abs() <= limit * 1.000_001 + 1e-4);
        }
    }

    #[test]
    fn unlimited_there_is_no_leak(errors in prop::collection::vec(-5f32..5.0, 1..200)) {
        let pi = Pi { k_c: 55.3, z_c: 0.9538 };
        let (mut told, mut untold) = (PiState::default(), PiState::default());
        for e in errors {
            let u = pi.step(&mut told, e);
            told.back_calculate(0.0);
            prop_assert_eq!(u.to_bits(), pi.step(&mut untold, e).to_bits());
            prop_assert_eq!(told, untold);
        }
        // Without error the output stays constant.
        pi.step(&mut told, 0.0);
        let held = told.output;
        for _ in 0..10_000 {
            prop_assert_eq!(pi.step(&mut told, 0.0), held);
        }
    }

    #[test]
    fn any_error_goes_through_and_what_is_not_finite_stays(bits in any::<[u32; 8]>()) {
        let pi = DqPi { d: Pi { k_c: 55.3, z_c: 0.9538 }, q: Pi { k_c: 51.2, z_c: 0.9534 } };
        let mut state = DqPiState::default();
        for b in bits {
            pi.step(&mut state, Dq::new(f32::from_bits(b), f32::NAN));
        }
        prop_assert!(!pi.step(&mut state, Dq::ZERO).q.is_finite());
    }
}
