//! Starts on motors with more and less saliency: which ones does the drive refuse?

use drive_core::{Command, Fault, Mode, State};

use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment, SPEED_LOOP, TURNING};
use crate::config::Config;
use crate::error::Error;
use crate::outcome::{Cell, Outcome, Table};
use crate::rig::{RATE_HZ, Rig};
use drive_core::carrier::DemodulatorKind;
use drive_core::settings::AngleSource;

/// Not in the source: without saliency its method cannot work, and nothing would tell.
pub const EXPERIMENT: Experiment = Experiment {
    name: "saliency-check",
    stands_for: "what section 3.5 takes for granted",
    about: "Starts on motors with none, a tenth, half and all of the expected saliency; `--set runs=N`.",
    uses: &[BENCH, DRIVE, &["prepare.learn", "runs"]],
    not: &[TURNING, SPEED_LOOP],
    run,
};

/// Share of the configured flux-fixed saliency, and its name in the metrics.
const SHARES: [(f64, &str); 5] =
    [(0.0, "none"), (0.1, "a_tenth"), (0.5, "half"), (1.0, "all"), (1.5, "one_and_a_half")];
const RUNS: u32 = 100;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let runs = context.config.extent.runs.unwrap_or(RUNS);
    let seeds: Vec<u64> = (0..u64::from(runs))
        .map(|n| context.seed.wrapping_mul(1_000_003).wrapping_add(n))
        .collect();
    let mut outcome = Outcome::default();
    let heads = ["share of the expected saliency", "starts", "accepted", "refused"];
    let mut table = Table::new("Starts", &heads);
    for (share, name) in SHARES {
        let mut config = context.config.clone();
        config.saliency.a_psi *= share;
        let accepted =
            context.in_parallel("saliency-check", &seeds, |_, &seed| accepts(&config, seed))?;
        let count = accepted.iter().filter(|&&a| a).count() as f64;
        outcome.metrics.set(format!("accepted_{name}"), count);
        table.row([
            Cell::fixed(share, 1),
            Cell::fixed(f64::from(runs), 0),
            Cell::fixed(count, 0),
            Cell::fixed(f64::from(runs) - count, 0),
        ]);
    }
    outcome.metrics.set("runs", f64::from(runs));
    outcome.tables.push(table);
    outcome.remarks = assumptions(context.config);
    Ok(outcome)
}

/// Whether the drive starts on this motor.
fn accepts(config: &Config, seed: u64) -> Result<bool, Error> {
    let mut config = config.clone();
    config.drive.angle_source = AngleSource::Injection;
    // A start is checked, not a learning.
    config.prepare.learn = false;
    config.drive.injection.demodulator = DemodulatorKind::Synchronous;
    let mut rig = Rig::from_config(&config, seed)?;
    rig.command(&Command::Start(Mode::Torque))?;
    for _ in 0..(10.0 * RATE_HZ) as u32 {
        rig.step();
        match rig.drive.state() {
            State::Torque => return Ok(true),
            State::Fault(Fault::NoSaliency) => return Ok(false),
            State::Fault(fault) => {
                return Err(Error::Refused(format!(
                    "a start ended in fault {}: {fault}",
                    fault.code()
                )));
            }
            _ => {}
        }
    }
    Err(Error::Refused(format!("the drive does not start: it is {}", rig.drive.state())))
}
