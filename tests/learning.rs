//! Procedure: the drive learns the saliency of its motor with the shaft locked, then drives it.

use crate::common::{all, angle_error, config, run};
use drive_core::learned::Learned;
use drive_core::table::ReferenceTable;
use drive_core::{Command, Fault, Mode, State, Stop};
use hil_sim::experiments::learning;
use hil_sim::plant::Load;
use hil_sim::rig::Rig;
use hil_sim::stats::Stats;

fn learned(changes: &[&str], seed: u64) -> Learned {
    let learned = learning::learned(&config(changes), seed).unwrap();
    assert!(learned.verdict.is_accepted(), "{changes:?}: {learned:?}");
    learned
}

/// The drive's default saliency offset equals the one that it learns on the default motor.
#[test]
fn learning_finds_the_default_reference() {
    let ideal = ["measurement.noise_a=0", "measurement.lsb_a=0.00014"];
    // Noise of 5 mA leaves 0.0005 rms at one sign after a second.
    for (changes, most) in [(&ideal[..], 1e-4), (&[][..], 1.5e-3)] {
        let found = learned(changes, 8);
        assert_eq!(found.points, 13);
        for n in 0..=found.points {
            let (i_q, default) = (0.25 * n as f32, ReferenceTable::default());
            let difference = found.reference.at(i_q) - default.at(i_q);
            assert!(difference.abs() < most, "{i_q} A: {difference}");
        }
        // The saliency of the current is 0.036 /A in the motor; the law leaves out the part that rotates with it.
        assert!(found.current_saliency.accepted);
        assert!((found.current_saliency.value - 0.0338).abs() < 0.002);
        assert!((found.flux_saliency + 0.035).abs() < 0.006, "{}", found.flux_saliency);
    }
}

/// A gain difference is found to a quarter of a percent, in either channel.
#[test]
fn a_gain_mismatch_of_the_sensors_is_found() {
    for (change, mismatch) in [
        ("measurement.gain_error_a=0.01", 0.01),
        ("measurement.gain_error_b=0.01", -0.01),
        ("measurement.gain_error_a=-0.03", -0.03),
        ("measurement.gain_error_a=0", 0.0),
    ] {
        let found = learned(&[change], 9).gain_mismatch;
        assert!(found.accepted && (found.value - mismatch).abs() < 0.0025, "{change}: {found:?}");
    }
}

/// A gain difference of 1 % between the sensors: the angle error before the self-commissioning, and the remaining one after it.
#[test]
fn after_learning_a_mismatch_costs_no_accuracy() {
    let mismatch = ["runs=24", "measurement.gain_error_a=0.01"];
    let before = run("monte-carlo", &mismatch, 41).metrics;
    let after = run("monte-carlo", &all(&[&mismatch, &["prepare.learn=true"]]), 41).metrics;
    let rms = |m: &hil_sim::outcome::Metrics| m.get("angle_error_rms_deg").unwrap();
    // 2.9 before, since the drive follows a mismatch only while the flux rotates.
    assert!(rms(&before) > 2.6, "{before:?}");
    assert!(rms(&after) <= 2.3, "{after:?}");
    assert!(after.get("worst_run_rms_deg").unwrap() <= 3.2);
    assert_eq!(after.get("lost_runs"), Some(0.0));
}

/// If the shaft turns, freely or driven slowly, this is detected, and nothing is changed.
#[test]
fn a_shaft_that_moves_is_refused() {
    // Without the check at the start, which itself refuses a rotating shaft.
    let config = config(&["injection.check=false"]);
    for load in [Load::Free { torque: 0.0 }, Load::Speed { speed: 6.0 }] {
        let mut rig = Rig::from_config(&config, 5).unwrap();
        rig.set_load(load).unwrap();
        let error = rig.learn().unwrap_err();
        assert_eq!(rig.drive.state(), State::Fault(Fault::ShaftNotLocked), "{load:?}: {error}");
        assert!(rig.drive.learned().is_none());
        assert!(rig.time() < 35.0);
    }
}

/// The self-commissioning can be stopped at any time and does not accept torque commands; without injection it is refused.
#[test]
fn learning_takes_stop_and_no_other_reference() {
    let mut rig = Rig::from_config(&config(&[]), 6).unwrap();
    rig.start(Mode::Learning).unwrap();
    rig.wait(5.0);
    assert!(rig.command(&Command::Torque(1.0)).is_err());
    assert!(rig.command(&Command::Magnetising(1.0)).is_err());
    assert_eq!(rig.drive.state(), State::Learning);
    rig.command(&Command::Stop(Stop::Coast)).unwrap();
    rig.wait(0.5);
    assert_eq!(rig.drive.state(), State::Off);
    assert!(rig.drive.learned().is_none());

    let without: [&[&str]; 2] = [
        &["injection.demodulator=literal"],
        &["injection.amplitude_v=0", "injection.monitor=false"],
    ];
    for changes in without {
        let mut rig = Rig::from_config(&config(changes), 6).unwrap();
        assert!(rig.command(&Command::Start(Mode::Learning)).is_err(), "{changes:?}");
    }
}

/// The rectified chain of the source with a learned saliency offset, shaft locked.
#[test]
fn the_rectified_chain_tracks_with_a_learned_reference() {
    let changes = ["injection.demodulator=rectified"];
    for seed in 1..=2 {
        let mut rig = Rig::from_config(&config(&changes), seed).unwrap();
        rig.learn().unwrap();
        let mut error = Stats::default();
        for i_q in [1.0, 2.0, 3.0, -0.75, -1.5, -2.5] {
            rig.start(Mode::Torque).unwrap();
            rig.command(&Command::Torque(i_q)).unwrap();
            rig.wait(1.0);
            error.add(&angle_error(&mut rig, 1.0));
            rig.command(&Command::Stop(Stop::Coast)).unwrap();
            rig.wait(1.5); // until the flux has decayed
        }
        let (rms, largest) = (error.rms(), error.largest());
        assert!(rms <= 2.5 && largest <= 9.0, "{rms} {largest}");
    }
}
