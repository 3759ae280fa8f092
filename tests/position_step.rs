//! Procedure: a position step of five turns with the encoder (Figure 37).

use crate::common::run;

#[test]
fn five_turns_arrive_without_overshoot() {
    for seed in [1, 2] {
        let outcome = run("position-step", &[], seed);
        let metric = |name| outcome.metrics.get(name).unwrap();
        println!("{:?}", outcome.metrics);
        assert!(metric("overshoot_pct") < 2.0);
        assert!(metric("settling_s") <= 3.5);
        assert!(metric("iq_max_a") < 3.3);
        assert!(metric("speed_max_rpm") < 1440.0 * 1.02);
        assert!(metric("angle_error_max_deg") < 5.0);
    }
}
