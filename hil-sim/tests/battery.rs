//! Verdicts of the stress test (battery) that compare its runs; those with bounds are in `bounds.toml`.

use hil_sim::outcome::Metrics;
use hil_sim::{Config, experiments};

fn battery(set: &[&str]) -> Metrics {
    let config = Config::load(None, None, set).expect("allowed settings");
    experiments::run("battery", &config, 1).expect("a battery").metrics
}

fn get(metrics: &Metrics, name: &str) -> f64 {
    metrics.get(name).unwrap_or(0.0)
}

/// A drive without observer that may track only up to 100 rpm stops the runs at higher speeds, at a right angle. A
/// drive without saliency stops runs whose angle is wrong.
#[test]
fn sound_runs_that_are_stopped_are_told_from_others() {
    let sound = battery(&["observer.enabled=no", "injection.tracked_rpm=100", "runs=12"]);
    assert!(get(&sound, "trips") >= 4.0, "{sound:?}");
    assert_eq!(get(&sound, "sound_runs_stopped"), get(&sound, "trips"));
    let wrong =
        battery(&["observer.enabled=no", "saliency.a_psi=0", "injection.check=no", "runs=48"]);
    assert!(get(&wrong, "trips") >= 8.0, "{wrong:?}");
    assert!(get(&wrong, "sound_runs_stopped") <= 0.25 * get(&wrong, "trips"), "{wrong:?}");
}

/// Random disturbances depend on the seed alone, in any order of the runs, and reduce the accuracy.
#[test]
fn drawn_disturbances_cost_accuracy() {
    let motor = ["plant=r", "flux_level=high", "sequence.flux=high"];
    let run = |set: &str| battery(&[&motor[..], &["prepare.learn=yes", "runs=12", set]].concat());
    let (none, drawn) = (run("disturbed.drawn=0"), run("disturbed.drawn=1"));
    let rms = |metrics: &Metrics| get(metrics, "angle_error_rms_deg");
    assert!(rms(&drawn) > 1.2 * rms(&none), "{} {}", rms(&drawn), rms(&none));
    assert_eq!(rms(&drawn), rms(&run("disturbed.drawn=1")));
}
