//! Tests of the states of a filter: they are linear and bounded, and decay.

use induction_drive_core::AlphaBeta;
use induction_drive_core::filter::{BPF, LPF, PP, Sos, SosState};
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_vector_is_two_signals(xs in prop::collection::vec((-5f32..5.0, -5f32..5.0), 1..200)) {
        let mut both = SosState::default();
        let (mut alpha, mut beta) = (SosState::default(), SosState::default());
        for (a, b) in xs {
            let y = LPF.step(&mut both, AlphaBeta::new(a, b));
            // The outputs are equal to the bit.
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
        let (mut one, mut two, mut mixed) = (SosState::default(), SosState::default(), SosState::default());
        for (x, y) in xs {
            let apart = p * PP.step(&mut one, x) + q * PP.step(&mut two, y);
            let together = PP.step(&mut mixed, p * x + q * y);
            prop_assert!((apart - together).abs() < 1e-4, "{} {}", apart, together);
        }
    }

    #[test]
    fn bounded_and_forgetting(xs in prop::collection::vec(-3f32..3.0, 1..2000)) {
        // The bounds are the sums of |h| of `impulse_responses_sum_to_a_known_bound`.
        let (mut lpf, mut bpf, mut pp) = (SosState::default(), SosState::default(), SosState::default());
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
    fn any_bits_go_through_and_what_is_not_finite_stays(
        xs in prop::collection::vec(any::<u32>(), 1..50),
    ) {
        let (mut scalar, mut vector) = (SosState::default(), SosState::default());
        for bits in xs {
            let x = f32::from_bits(bits);
            LPF.step(&mut scalar, x);
            LPF.step(&mut vector, AlphaBeta::new(x, -x));
        }
        LPF.step(&mut scalar, f32::NAN);
        LPF.step(&mut vector, AlphaBeta::new(0.0, f32::INFINITY));
        for _ in 0..10 {
            prop_assert!(!LPF.step(&mut scalar, 0.0).is_finite());
            prop_assert!(!LPF.step(&mut vector, AlphaBeta::ZERO).is_finite());
        }
    }
}

#[test]
fn impulse_responses_sum_to_a_known_bound() {
    fn sum<const N: usize>(filter: &Sos<N>) -> f32 {
        let mut state = SosState::default();
        (0..6000).map(|k| filter.step(&mut state, if k == 0 { 1.0 } else { 0.0 }).abs()).sum()
    }
    let sums = [sum(&LPF), sum(&BPF), sum(&PP)];
    assert!(sums[0] < 4.18 && sums[1] < 1.56 && sums[2] < 1.66, "{sums:?}");
}
