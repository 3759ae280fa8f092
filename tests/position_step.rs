//! Procedure: a position step of five turns with the encoder (Figure 37).

mod common;

use common::config;
use hil_sim::experiments::{self, Context};
use hil_sim::progress::Progress;

#[test]
fn five_turns_arrive_without_overshoot() {
    for seed in [1, 2] {
        let outcome = (experiments::find("position-step").unwrap().run)(&Context {
            config: &config(&[]),
            seed,
            seconds: None,
            progress: Progress::hidden(),
        })
        .unwrap();
        let metric = |name| outcome.metrics.get(name).unwrap();
        println!("{:?}", outcome.metrics);
        assert!(metric("overshoot_pct") < 2.0);
        assert!(metric("settling_s") <= 3.5);
        assert!(metric("iq_max_a") < 3.3);
        assert!(metric("speed_max_rpm") < 1440.0 * 1.02);
        assert!(metric("angle_error_max_deg") < 5.0);
    }
}
