//! Procedure: torque steps and ramp with a locked shaft and no position sensor (Figures 38 and 39).

mod common;

use common::{IDEAL, all, config};
use hil_sim::Outcome;
use hil_sim::experiments::{self, Context};
use hil_sim::progress::Progress;

fn run(name: &str, changes: &[&str], seed: u64) -> Outcome {
    (experiments::find(name).unwrap().run)(&Context {
        config: &config(changes),
        seed,
        seconds: None,
        progress: Progress::hidden(),
    })
    .unwrap()
}

/// The source compensates no delay.
const AS_PRINTED: [&str; 1] = ["angle.compensate_delays=false"];

/// G5: rectified, 10 mA, k_s 0.132546, z_s 0.9 on plant A without noise: with the delays left as in
/// the source, and compensated.
#[test]
fn the_rectified_chain_tracks_within_13_degrees() {
    for name in ["torque-steps", "torque-ramp"] {
        for more in [&AS_PRINTED[..], &[]] {
            let outcome = run(name, &all(&[&IDEAL, more]), 1);
            println!("{name} {more:?}: {:?} {:?}", outcome.metrics, outcome.steps);
            assert!(outcome.metrics.get("angle_error_max_deg").unwrap() <= 13.0, "{name}");
            assert_eq!(outcome.metrics.get("lost"), Some(0.0));
        }
    }
}

/// With converter, noise and dead-time residual, default settings, several seeds.
#[test]
fn the_default_drive_holds_torque_with_a_realistic_measurement() {
    for seed in 1..=5 {
        let outcome = run("torque-steps", &[], seed);
        println!("{:?}", outcome.metrics);
        assert_eq!(outcome.metrics.get("lost"), Some(0.0));
        // 3.7 to 4.1 rms and 11.2 to 12.8 largest over the first six seeds; noise decides the rest.
        assert!(outcome.metrics.get("angle_error_rms_deg").unwrap() <= 5.0);
        assert!(outcome.metrics.get("angle_error_max_deg").unwrap() <= 16.0);
    }
}

/// The torque follows Eq. 4.4 with the true flux and angle, whatever the angle error.
#[test]
fn torque_follows_equation_4_4() {
    let outcome = run("torque-steps", &[], 3);
    let difference = outcome.metrics.get("torque_minus_eq_4_4_rms_nm").unwrap();
    // The carrier on the torque axis makes 0.083 Nm peak of ripple; the equation has none of it.
    assert!(difference < 0.075, "{difference} Nm");
}

/// A weak saliency with the constant 10 mA reference is the likeliest reading of the 40° to 60° of
/// the source: with a tenth of the assumed saliency the same chain errs by tens of degrees.
#[test]
fn a_tenth_of_the_saliency_gives_tens_of_degrees() {
    let weak = ["saliency.a_psi=-0.0035"];
    let outcome = run("torque-steps", &all(&[&IDEAL, &AS_PRINTED, &weak]), 1);
    let mean = outcome.metrics.get("angle_error_mean_deg").unwrap();
    println!("mean error {mean}");
    assert!((20.0..60.0).contains(&mean), "{mean}");
}

#[test]
fn negative_torque_works_as_well() {
    let outcome = run("torque-steps", &["reference.iq_a=-1"], 4);
    println!("{:?}", outcome.metrics);
    assert_eq!(outcome.metrics.get("lost"), Some(0.0));
    assert!(outcome.steps.unwrap().iter().all(|s| s.torque_nm < -0.2));
}
