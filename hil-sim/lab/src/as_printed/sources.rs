//! Table 1 as runs: encoder, fundamental model and injection at standstill, near it and far from it.

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

/// Adds the table of runs and the comparisons.
pub fn add(context: &Context<'_>, outcome: &mut Outcome) -> Result<(), Error> {
    let mut table = texts::table("as-printed", "sources");
    for column in COLUMNS {
        // By definition of the columns.
        let without = f64::from(column != COLUMNS[0]);
        let place = beside("Table 1, works without encoder", column);
        outcome.compared.push(place.of_print(without));
        for (row, rpm) in SPEEDS {
            let found = tracked(context, column, rpm)?;
            // The method works if the angle it gives is right: by injection while it is on, otherwise by the model.
            let by_it = |(error, carrier): (f64, f64)| {
                let by = if carrier > 1.0 { COLUMNS[2] } else { COLUMNS[1] };
                error < LOST_DEG && (column == COLUMNS[0] || column == by)
            };
            let works = found.is_some_and(by_it);
            let shown = |of: fn((f64, f64)) -> f64| Cell::fixed_or_dash(found.map(of), 1);
            table.record([
                ("angle source", Cell::from(column)),
                ("speed (rpm)", Cell::fixed(rpm, 0)),
                ("largest error (°)", shown(|f| f.0)),
                ("carrier current (mA)", shown(|f| f.1)),
                ("works", Cell::from(if works { "yes" } else { "no" })),
            ]);
            let unknown =
                (column == COLUMNS[1]).then_some("how near to zero it means, and the load");
            let place = beside(&format!("Table 1, {row}"), column);
            outcome.compared.push(Compared { unknown, ..place }.simulated(works));
        }
    }
    outcome.tables.push(table);
    Ok(())
}

/// Largest angle error, degrees, and injection current, mA; nothing if the drive does not start or stops itself.
fn tracked(context: &Context<'_>, column: &str, rpm: f64) -> Result<Option<(f64, f64)>, Error> {
    let mut config = context.config.clone();
    if column == COLUMNS[0] {
        config.drive.angle_source = AngleSource::Encoder;
    }
    if column == COLUMNS[1] && rpm < SPEEDS[2].1 {
        config.drive.injection.amplitude_v = Some(0.0);
        config.drive.injection.synchronous.check = false;
    }
    let Ok(mut rig) = prepared(&config, context.seed) else { return Ok(None) };
    if bring_up(&mut rig, rpm).is_err() || rig.drive.state().fault().is_some() {
        return Ok(None);
    }
    rig.settle(&Command::Torque(IQ_A as f32), 1.0)?;
    let [error, carrier] = rig.stats(1.0, |p| [p.angle_error_deg, 1e3 * p.carrier]);
    Ok(rig.drive.state().fault().is_none().then_some((error.largest(), carrier.mean())))
}
