//! Every experiment includes all parts of the drive: a heat sink near its limit lowers the torque in all of them.

use hil_sim::outcome::Metrics;
use hil_sim::{Config, experiments};

/// Temperature between 70 °C, at which the current limit starts to decrease, and 85 °C, where it ends: a fifth to a
/// third of the square of the current remains.
const HOT: &str = "measurement.heat_sink_c=77";

fn metrics(name: &str, set: &[&str]) -> Metrics {
    let config = Config::load(None, None, set).expect("allowed settings");
    experiments::run(name, &config, 1).expect("an outcome").metrics
}

/// With an encoder the torque corresponds to the current. A cold heat sink gives the commanded torque; a hot one gives
/// a lower torque and a lower largest current.
#[test]
fn a_hot_heat_sink_lowers_the_torque_in_every_experiment() {
    let encoder = "angle_source=encoder";
    let of = |name: &str, set: &[&str], metric: &str| {
        let value = |more: &[&str]| {
            let metrics = metrics(name, &[set, more].concat());
            metrics.get(metric).unwrap_or_else(|| panic!("{name}: no {metric}"))
        };
        (value(&[encoder]), value(&[encoder, HOT]))
    };
    // In % of the torque at the limit, mean over constant q-axis currents of 0.5 to 3 A, of which 1.5 A and more are reduced.
    let (cold, hot) = of("battery", &["runs=6"], "torque_error_mean_pct");
    assert!(cold.abs() < 0.5 && hot < -2.0, "battery: {cold} and {hot}");
    let constant = ["full_range.kind=constant", "runs=2"];
    let (cold, hot) = of("full-range", &constant, "constant_750_1200_current_peak_a");
    assert!(hot < 0.8 * cold, "full-range: {cold} and {hot}");
    let (cold, hot) = of("torque-envelope", &[], "torque_motoring_311_v_0_rpm_nm");
    assert!(hot < 0.7 * cold, "torque-envelope: {cold} and {hot}");
}
