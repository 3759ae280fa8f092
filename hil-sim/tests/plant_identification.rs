//! The plant of the current loop, identified through the drive, is the motor's.

use hil_sim::{Config, experiments};

#[test]
fn through_the_drive_the_plant_is_that_of_the_motor() {
    for seed in [1, 2] {
        let outcome = experiments::run("plant-identification", &Config::default(), seed).unwrap();
        let metric = |name: &str| outcome.metrics.get(name).unwrap();
        // Independent check: exact hold of 1/(R' + s sigma L_s) of Table 5, k = 0.0032052, p = 0.980053. On d the
        // saliency of 3.5 % along the flux remains; on q the saliency of the current, 7 % at 2 A.
        for (key, k_bound) in [("steps", 0.05), ("d", 0.05), ("q", 0.15)] {
            let (k, p) = (metric(&format!("{key}_k_a_per_v")), metric(&format!("{key}_p")));
            assert!((k / 0.003_205_2 - 1.0).abs() < k_bound, "{key}: k = {k}");
            assert!((p - 0.980_053).abs() < 0.006, "{key}: p = {p}");
            assert!(metric(&format!("{key}_left_rms_a")) < 0.012);
            assert!(metric(&format!("{key}_condition")) < 100.0);
        }
        // The delay is the period between sample and voltage, and no more.
        assert_eq!(metric("d_delay_samples"), 1.0);
        assert_eq!(metric("q_delay_samples"), 1.0);
    }
}
