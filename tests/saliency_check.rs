//! Procedure: start the sensorless drive on motors with more and less saliency.

use std::thread;

use crate::common::{Rig, config};
use drive_core::{AngleSource, Command, Fault, Mode, State};
use hil_sim::Config;
use hil_sim::rig::RATE_HZ;

/// Shares of the expected saliency, and whether a drive starts with each.
const SHARES: [(f64, bool); 5] =
    [(0.0, false), (0.1, false), (0.5, true), (1.0, true), (1.5, true)];
/// Seeds of the starts in the long proof.
const LONG: u64 = 1000;

/// Whether the drive starts on this motor.
fn is_accepted(config: &Config, seed: u64) -> bool {
    let mut rig = Rig::from_config(config, seed).unwrap();
    rig.command(&Command::Start(Mode::Torque)).unwrap();
    for _ in 0..(10.0 * RATE_HZ) as u32 {
        rig.step();
        match rig.drive.state() {
            State::Torque => return true,
            State::Fault(Fault::NoSaliency) => return false,
            State::Fault(fault) => panic!("seed {seed}: a start ended in fault {fault}"),
            _ => {}
        }
    }
    panic!("seed {seed}: the drive does not start: it is {}", rig.drive.state());
}

fn starts(seeds: u64) {
    let cores = thread::available_parallelism().map_or(1, |cores| cores.get() as u64);
    for (share, starts) in SHARES {
        let mut config = config(&[]);
        config.drive.angle_source = AngleSource::Injection;
        config.saliency.a_psi *= share;
        let count = |core| {
            (1 + core..=seeds).step_by(cores as usize).filter(|&n| is_accepted(&config, n)).count()
        };
        let accepted: usize = thread::scope(|scope| {
            let count = &count;
            let parts: Vec<_> = (0..cores).map(|core| scope.spawn(move || count(core))).collect();
            parts.into_iter().map(|part| part.join().unwrap()).sum()
        });
        assert_eq!(accepted as u64, if starts { seeds } else { 0 }, "{share}");
    }
}

/// The limit is 3.8 standard deviations from a tenth and from half of the saliency.
#[test]
fn a_motor_without_saliency_is_refused_and_one_with_half_of_it_is_not() {
    starts(60);
}

#[test]
#[ignore = "5000 starts; cargo xtask prove saliency-check runs it"]
fn in_many_starts() {
    starts(LONG);
}
