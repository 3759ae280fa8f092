//! Starts on motors with more and less saliency: which ones does the drive refuse?

use drive_core::{Command, Fault, Mode, State};

use super::statistics::{Study, whole};
use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment, SPEED_LOOP, TURNING};
use crate::config::Config;
use crate::error::Error;
use crate::outcome::{Cell, Outcome, Table};
use crate::rig::{RATE_HZ, Rig};
use drive_core::AngleSource;
use drive_core::carrier::DemodulatorKind;

/// Not in the source: without saliency its method cannot work, and nothing would tell.
pub const EXPERIMENT: Experiment = Experiment {
    name: "saliency-check",
    stands_for: "what section 3.5 takes for granted",
    about: "Starts on motors with none, a tenth, half and all of the expected saliency; `--set runs=N`.",
    uses: &[BENCH, DRIVE, &["prepare.learn", "runs"]],
    not: &[TURNING, SPEED_LOOP],
    run: whole::<SaliencyCheck>,
};

/// Share of the configured flux-fixed saliency, and its name in the metrics.
const SHARES: [(f64, &str); 5] =
    [(0.0, "none"), (0.1, "a_tenth"), (0.5, "half"), (1.0, "all"), (1.5, "one_and_a_half")];
const RUNS: u32 = 100;

/// The starts: `runs` with each share.
pub struct SaliencyCheck {
    config: Config,
    seed: u64,
    runs: usize,
}

impl Study for SaliencyCheck {
    type Record = bool;
    const EXPERIMENT: &'static Experiment = &EXPERIMENT;

    fn new(context: &Context<'_>) -> Result<Self, Error> {
        let config = context.config.clone();
        let runs = config.extent.runs.unwrap_or(RUNS) as usize;
        Ok(Self { config, seed: context.seed, runs })
    }

    fn runs(&self) -> usize {
        SHARES.len() * self.runs
    }

    fn run(&self, number: usize) -> Result<bool, Error> {
        let mut config = self.config.clone();
        config.saliency.a_psi *= SHARES[number / self.runs].0;
        let of_share = (number % self.runs) as u64;
        accepts(&config, self.seed.wrapping_mul(1_000_003).wrapping_add(of_share))
    }

    fn outcome(&self, _: &Context<'_>, accepted: Vec<bool>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        let mut table = Table::new("Starts", &[]);
        let runs = self.runs as f64;
        for ((share, name), accepted) in SHARES.iter().zip(accepted.chunks(self.runs)) {
            let count = accepted.iter().filter(|&&a| a).count() as f64;
            outcome.metrics.set(format!("accepted_{name}"), count);
            table.record([
                ("share of the expected saliency", Cell::fixed(*share, 1)),
                ("starts", Cell::fixed(runs, 0)),
                ("accepted", Cell::fixed(count, 0)),
                ("refused", Cell::fixed(runs - count, 0)),
            ]);
        }
        outcome.metrics.set("runs", runs);
        outcome.tables.push(table);
        outcome.remarks = assumptions(&self.config);
        Ok(outcome)
    }
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
