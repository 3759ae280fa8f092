//! States: what a filter remembers is linear, bounded, and forgotten.

use drive_core::AlphaBeta;
use drive_core::filter::dissertation::{BPF, LPF, PP};
use drive_core::filter::sos::{AlphaBetaState, Sos, SosState};
use proptest::prelude::*;

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
