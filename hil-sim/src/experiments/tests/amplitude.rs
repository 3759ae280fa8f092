//! Angle error at standstill over the amplitude of the injection.

use super::steady::{OperatingPoint, steady_run};
use crate::prelude::*;

/// Runs the experiment, which is no figure of the source.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let mut table = Table::new("Angle error", &["amplitude (V)", "rms (°)"]);
    for volts in [40.0, 50.0, 80.0] {
        let mut config = context.config.clone();
        config.drive.injection.amplitude_v = Some(volts as f32);
        let case = OperatingPoint { rpm: 0.0, iq: 1.0, seed: context.seed };
        let run = steady_run(&config, case, context.seconds.unwrap_or(2.0))?;
        table.row([Cell::fixed(volts, 0), Cell::fixed(run.error.rms(), 2)]);
        outcome.metrics.set(format!("rms_at_{volts}_v_deg"), run.error.rms());
    }
    outcome.tables.push(table);
    Ok(outcome)
}
