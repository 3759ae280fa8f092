//! Procedure: start the sensorless drive on motors with more and less saliency.

mod common;

use common::run;

/// A share of what `cargo sim run saliency-check --set runs=1000` shows.
#[test]
fn a_motor_without_saliency_is_refused_and_one_with_half_of_it_is_not() {
    let outcome = run("saliency-check", &["runs=60"], 5);
    let accepted = |name| outcome.metrics.get(&format!("accepted_{name}")).unwrap();
    println!("{:?}", outcome.metrics);
    // 3.8 standard deviations lie between the limit and either a tenth or half.
    for name in ["none", "a_tenth"] {
        assert_eq!(accepted(name), 0.0, "{name}");
    }
    for name in ["half", "all", "one_and_a_half"] {
        assert_eq!(accepted(name), 60.0, "{name}");
    }
}
