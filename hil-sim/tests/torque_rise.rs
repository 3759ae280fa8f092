//! Steps of the torque, compared with the limit that the voltage sets.

use hil_sim::{Config, experiments};

/// The bounds of a step to 90 %, on two drives that have learned: motoring without injection 1.5 times the physical
/// limit and 0.5 ms, otherwise 1.0 ms; overshoot 10 %; the largest current below 0.9 of the trip. The angle at
/// standstill has the noise of the injection: ten seeds give 3.8 to 5.9 degrees.
#[test]
fn the_torque_follows_near_its_physical_limit() {
    for seed in [1, 2] {
        let outcome = experiments::run("torque-rise", &Config::default(), seed).unwrap();
        let get = |name: &str| outcome.metrics.get(name).expect(name);
        assert!(get("motoring_beyond_ms") <= 0.5, "{:?}", outcome.metrics);
        assert!(get("other_beyond_ms") <= 1.0, "{:?}", outcome.metrics);
        assert!(get("overshoot_pct") <= 10.0, "{:?}", outcome.metrics);
        assert!(get("peak_pct_of_trip") < 90.0, "{:?}", outcome.metrics);
        assert!(get("angle_error_max_deg") < 7.0, "{:?}", outcome.metrics);
    }
}
