//! Everything that shakes the angle, in one report: torque steps, reversals, load steps, and the sweep
//! over speed and torque.

use super::{
    BENCH, Context, DRIVE, Experiment, perturbation, reversal, speed_profile, sweep, torque,
};
use crate::error::Error;
use crate::outcome::Outcome;

/// The disturbances that section 5.2 names, with the default drive.
pub const EXPERIMENT: Experiment = Experiment {
    name: "tracking",
    stands_for: "Figure 38, section 5.2",
    about: "Torque steps, reversals, load steps, speed profile and sweep, in one report.",
    uses: &[BENCH, DRIVE, &["load.", "reference.iq_a", "prepare.learn", "seconds"]],
    not: &[],
    run,
};

/// The parts: how their metrics and figures begin, the experiment, and the true rotor resistance over
/// the one the drive believes.
const PARTS: [(&str, &Experiment, f64); 6] = [
    ("steps", &torque::STEPS, 1.0),
    ("reversal", &reversal::EXPERIMENT, 1.0),
    ("reversal_warm", &reversal::EXPERIMENT, 1.3),
    ("perturbation", &perturbation::EXPERIMENT, 1.0),
    ("profile", &speed_profile::EXPERIMENT, 1.0),
    ("sweep", &sweep::EXPERIMENT, 1.0),
];

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut whole = Outcome::default();
    for (prefix, experiment, warmer) in PARTS {
        let mut config = context.config.clone();
        config.motor.r_r *= warmer;
        let progress = context.progress.clone();
        let part = (experiment.run)(&Context { config: &config, progress, ..*context })?;
        for (name, value) in part.metrics.iter() {
            whole.metrics.set(format!("{prefix}_{name}"), value);
        }
        let title = |title: &str| match warmer {
            1.0 => title.to_owned(),
            _ => format!("{title}, rotor {:.0} % warmer than believed", (warmer - 1.0) * 100.0),
        };
        for mut table in part.tables {
            table.title = title(&table.title);
            whole.tables.push(table);
        }
        for mut figure in part.figures {
            figure.name = format!("{prefix}-{}", figure.name);
            figure.title = title(&figure.title);
            whole.figures.push(figure);
        }
        whole.steps = whole.steps.or(part.steps);
        whole.faults.extend(part.faults.iter().map(|fault| format!("{}: {fault}", title(prefix))));
        for remark in part.remarks {
            if !whole.remarks.contains(&remark) {
                whole.remarks.push(remark);
            }
        }
    }
    Ok(whole)
}
