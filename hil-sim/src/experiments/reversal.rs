//! Steps and reversals of the torque current without a position sensor.

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Command, Mode};

use super::torque::{LOST_DEG, assumptions};
use super::{BENCH, Context, DRIVE, Experiment, SPEED_LOOP};
use crate::error::Error;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};
use crate::rig::{Point, Rig, means_over};
use crate::stats::Stats;

/// Section 5.2 asks for the response to disturbances.
pub const EXPERIMENT: Experiment = Experiment {
    name: "torque-reversal",
    stands_for: "section 5.2",
    about: "Sudden steps of the torque current up to full reversal, without a position sensor.",
    uses: &[BENCH, DRIVE, &["load.", "prepare.learn", "seconds"]],
    not: &[SPEED_LOOP],
    run,
};

/// Torque currents one after another on the dissertation's motor, A.
const LEVELS: [f64; 9] = [0.5, 1.0, 2.0, 3.0, 0.5, 2.0, -2.0, 3.0, -3.0];
/// Time at each, s.
const LEVEL_S: f64 = 1.0;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let level_s = context.seconds.map_or(LEVEL_S, |s| s / LEVELS.len() as f64);
    let mut rig = Rig::from_config(context.config, context.seed)?;
    rig.start(Mode::Torque)?;
    let start = rig.time();
    let mut points: Vec<Point> = Vec::new();
    let heads = ["from (A)", "to (A)", "largest error (°)", "mean error, second half (°)"];
    let mut table = Table::new("Angle error after each step", &heads);
    let (mut largest, mut before) = (0.0_f64, 0.0);
    for iq in LEVELS.map(|iq| context.config.amperes(iq)) {
        if rig.fault().is_some() {
            break;
        }
        rig.command(&Command::Torque(iq as f32))?;
        let first = points.len();
        rig.run(level_s, |p| points.push(Point { t: p.t - start, ..*p }));
        let error = |p: &[Point]| Stats::of(p.iter().map(|p| p.angle_error_deg));
        let (all, half) = (&points[first..], (points.len() - first) / 2);
        let peak = error(all).largest();
        // The first step starts from the magnetising position.
        if before != 0.0 {
            largest = largest.max(peak);
        }
        table.row([
            Cell::fixed(before, 1),
            Cell::fixed(iq, 1),
            Cell::fixed(peak, 2),
            Cell::fixed(error(&all[half..]).mean(), 2),
        ]);
        before = iq;
    }
    let mut outcome = Outcome::default();
    outcome.faults.extend(rig.fault());
    outcome.metrics.set("angle_error_max_deg", largest);
    outcome.metrics.set("lost", f64::from(u8::from(rig.fault().is_some() || largest > LOST_DEG)));
    outcome.tables.push(table);
    let line = |of: fn(&Point) -> f64| means_over(CARRIER_SAMPLES, &points, of);
    let x = "time (s)";
    outcome.figures.push(
        Figure::new("reversal", "Steps and reversals of the torque current", "section 5.2")
            .panel(
                Panel::new(x, "quadrature current (A)")
                    .with(Series::line("measured", line(|p| p.iq)))
                    .with(Series::reference("reference", line(|p| p.iq_ref))),
            )
            .panel(Panel::new(x, "torque (Nm)").with(Series::line("motor", line(|p| p.torque))))
            .panel(
                Panel::new(x, "angle error (° electrical)")
                    .with(Series::line("true minus estimated", line(|p| p.angle_error_deg))),
            ),
    );
    outcome.remarks = assumptions(context.config);
    Ok(outcome)
}
