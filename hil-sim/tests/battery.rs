//! Tests of the stress test (battery): its cross-check on the drive's own motor, and each of its verdicts on a motor
//! that causes it.

use hil_sim::outcome::Metrics;
use hil_sim::{Config, experiments};

fn battery(set: &[&str]) -> (Metrics, usize) {
    let config = Config::load(None, None, set).expect("allowed settings");
    let outcome = experiments::run("battery", &config, 1).expect("a battery");
    (outcome.metrics, outcome.faults.len())
}

fn get(metrics: &Metrics, name: &str) -> f64 {
    metrics.get(name).unwrap_or(0.0)
}

/// Without saliency there is nothing to track: fault 25 refuses each start, and there is no error to report.
#[test]
fn a_motor_without_saliency_is_refused() {
    let (metrics, faults) = battery(&["saliency.a_psi=0", "runs=12"]);
    assert_eq!(get(&metrics, "refused_starts"), 12.0);
    assert_eq!(get(&metrics, "refused_by_fault_25"), 12.0);
    assert!(get(&metrics, "angle_error_rms_deg").is_nan());
    assert_eq!((get(&metrics, "lost_runs"), faults), (0.0, 12));
}

/// With an encoder the slip determines the flux. If the drive assumes a slip `k` times too large, the current of 0.7 A
/// and `i_q` lies at `atan(k i_q/0.7)` from the flux, which is then `sqrt(0.49 + i_q^2)/0.7 / sqrt(1 + (k i_q/0.7)^2)`
/// of its nominal value: at 2 A and more 0.26 for k = 4, and 2.2 for k = 0.3.
#[test]
fn a_flux_that_is_too_small_or_too_large_is_counted() {
    let of_ratio = |k: f64| {
        let (source, r_r) = ("angle_source=encoder", format!("drive.motor.r_r={}", 1.1 * k));
        battery(&[source, &r_r, "runs=24"]).0
    };
    for k in [4.0, 0.3] {
        let metrics = of_ratio(k);
        assert!(get(&metrics, "flux_off_runs") >= 4.0, "{k}: {metrics:?}");
        assert!(get(&metrics, "flux_off_longest_s") > 1.0, "{k}: {metrics:?}");
    }
    assert_eq!(get(&of_ratio(1.0), "flux_off_runs"), 0.0);
}

/// With an encoder and an assumed rotor resistance `k` times too large, torque divided by command is `k (1 + x^2)/(1 +
/// (k x)^2)`, `x = i_q/i_d` (indirect field orientation, steady state). The stress test draws i_q evenly between 0.5
/// and 3 A at 0.7 A; the mean of 48 such runs has a standard error of 3 % of the torque at 3 A.
#[test]
fn the_torque_error_is_that_of_the_equations() {
    for k in [0.5_f64, 2.0] {
        let r_r = format!("drive.motor.r_r={}", 1.1 * k);
        let (metrics, _) = battery(&["angle_source=encoder", &r_r, "runs=96"]);
        let n = 1000;
        let error = |i_q: f64| {
            let x = i_q / 0.7;
            (k * (1.0 + x * x) / (1.0 + (k * x).powi(2)) - 1.0) * i_q / 3.0
        };
        let currents = (0..n).map(|step| 0.5 + 2.5 * (f64::from(step) + 0.5) / f64::from(n));
        let expected = 100.0 * currents.map(error).sum::<f64>() / f64::from(n);
        let found = get(&metrics, "torque_error_mean_pct");
        assert!((found - expected).abs() < 6.0, "{k}: {found}, expected {expected}");
        assert!(expected.abs() > 20.0);
    }
}

/// Values after the saliency self-commissioning act only on the runs: the drive learns a saliency that is absent at its
/// start, and fault 25 refuses each start. Without saliency from the beginning the self-commissioning is refused.
#[test]
fn values_after_the_learning_do_not_act_while_it_lasts() {
    let learn = |set: &str| battery(&["prepare.learn=yes", set, "runs=3"]).0;
    assert_eq!(get(&learn("after.saliency.a_psi=0"), "refused_by_fault_25"), 3.0);
    assert_eq!(get(&learn("saliency.a_psi=0"), "refused_starts"), 3.0);
    let fine = battery(&["prepare.learn=yes", "saliency.a_psi=0", "after.saliency.a_psi=-0.035"]);
    assert!(get(&fine.0, "refused_starts") > 0.0);
    let error = Config::load(None, None, &["after.plant=g"]).unwrap_err().to_string();
    assert!(error.contains("after.plant"), "{error}");
    let error = Config::load(None, None, &["after.motor.r_r=-1"]).unwrap_err();
    let text = "after.motor.r_r = -1: out of range; allowed: 0.0001 to 1000 ohm";
    assert_eq!(error.to_string(), text);
}

/// A drive without observer that may track only up to 100 rpm stops the runs at higher speeds, at a right angle. A
/// drive without saliency stops runs whose angle is wrong.
#[test]
fn sound_runs_that_are_stopped_are_told_from_others() {
    let (sound, _) = battery(&["observer.enabled=no", "injection.tracked_rpm=100", "runs=12"]);
    assert!(get(&sound, "trips") >= 4.0, "{sound:?}");
    assert_eq!(get(&sound, "sound_runs_stopped"), get(&sound, "trips"));
    let (wrong, _) = battery(&["saliency.a_psi=0", "injection.check=no", "runs=48"]);
    assert!(get(&wrong, "trips") >= 8.0, "{wrong:?}");
    assert!(get(&wrong, "sound_runs_stopped") <= 0.25 * get(&wrong, "trips"), "{wrong:?}");
}

/// If the flux is suddenly rotated, the drive finds it again or stops. Without saliency, lock monitor and observer it
/// stays wrong for a second.
#[test]
fn a_turned_flux_is_found_again_unless_nothing_is_there_to_find() {
    let (watched, faults) = battery(&["battery.runs=forced", "runs=27"]);
    assert_eq!((get(&watched, "silent_runs"), faults), (0.0, 0), "{watched:?}");
    // The flux was rotated: an angle error of 60° and more for longer than a period.
    assert!(get(&watched, "wrong_longest_s") > 0.01, "{watched:?}");
    let blind = [
        "battery.runs=forced",
        "runs=27",
        "saliency.a_psi=0",
        "injection.check=no",
        "injection.monitor=no",
        "observer.enabled=no",
    ];
    let (blind, _) = battery(&blind);
    let longest = get(&blind, "wrong_longest_s");
    assert!(get(&blind, "silent_runs") >= 9.0 && longest > 1.0, "{blind:?}");
}

/// Random disturbances depend on the seed alone, in any order of the runs, and reduce the accuracy.
#[test]
fn drawn_disturbances_cost_accuracy() {
    let motor = ["plant=r", "flux_level=high", "sequence.flux=high"];
    let run = |set: &str| battery(&[&motor[..], &["prepare.learn=yes", "runs=12", set]].concat()).0;
    let (none, drawn) = (run("disturbed.drawn=0"), run("disturbed.drawn=1"));
    let rms = |metrics: &Metrics| get(metrics, "angle_error_rms_deg");
    assert!(rms(&drawn) > 1.2 * rms(&none), "{} {}", rms(&drawn), rms(&none));
    assert_eq!(rms(&drawn), rms(&run("disturbed.drawn=1")));
}
