//! Table 1 as runs: encoder, fundamental model and injection at standstill, near it and far from it.

use sim_bench::plant::SaliencySettings;
use sim_bench::steady::{bring_up, prepared};

use crate::prelude::*;

/// Rows of the table, and their speeds, rpm.
const SPEEDS: [(&str, f64); 3] = [
    ("works at omega = 0", 0.0),
    ("works at omega near 0", 5.0),
    ("works at omega far above 0", 1500.0),
];
/// Columns of the table.
const COLUMNS: [&str; 3] = ["mechanical sensor", "fundamental model", "signal injection"];
const IQ_A: f64 = 1.5;

/// Adds the largest errors and the comparisons.
pub fn add(context: &Context<'_>, outcome: &mut Outcome) -> Result<(), Error> {
    for column in COLUMNS {
        for (row, rpm) in SPEEDS {
            let error = tracked(context, column, rpm)?;
            let name = format!("{}_{rpm}_rpm_error_max_deg", column.replace(' ', "_"));
            outcome.metrics.set(name, error);
            let unknown =
                (column == COLUMNS[1]).then_some("how near to zero it means, and the load");
            let place = beside(&format!("Table 1, {row}"), column);
            outcome.compared.push(Compared { unknown, ..place }.simulated(error < LOST_DEG));
        }
    }
    Ok(())
}

/// Largest angle error, degrees; not a number if the drive stops itself.
fn tracked(context: &Context<'_>, column: &str, rpm: f64) -> Result<f64, Error> {
    let mut config = context.config.clone();
    if column == COLUMNS[0] {
        config.drive.angle_source = AngleSource::Encoder;
    }
    config.drive.injection.synchronous.monitor &= column != COLUMNS[1];
    config.drive.observer.enabled &= column != COLUMNS[2];
    let mut rig = prepared(&config, context.seed)?;
    bring_up(&mut rig, rpm)?;
    if rig.drive.state().fault().is_some() {
        return Ok(f64::NAN);
    }
    if column == COLUMNS[1] {
        // The drive starts with its injection; then the motor loses its saliency, and the fundamental alone is left.
        let plant = plant_settings(&config);
        rig.plant.set_saliency(&plant.machine, &SaliencySettings::NONE).map_err(Error::refused)?;
    }
    // Without torque for a time: at standstill the fundamental then has no frequency.
    rig.settle(&Command::Torque(0.0), 10.0)?;
    rig.settle(&Command::Torque(IQ_A as f32), 1.0)?;
    let [error] = rig.stats(1.0, |p| [p.angle_error_deg]);
    Ok(if rig.drive.state().fault().is_some() { f64::NAN } else { error.largest() })
}
