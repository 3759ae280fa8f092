//! Torque over the torque current at standstill, and whether it or the angle drifts over a minute.

use super::steady::{OperatingPoint, at_speed};
use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment, FREE_SHAFT, SPEED_LOOP};
use crate::error::Error;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};
use crate::stats::Stats;

/// The source holds torque for seconds; a drive holds it for minutes.
pub const EXPERIMENT: Experiment = Experiment {
    name: "torque-drift",
    stands_for: "Eq. 4.4 over a minute",
    about: "Torque and angle at standstill over a minute, against the current and the first ten seconds.",
    uses: &[BENCH, DRIVE, &["prepare.learn", "seconds"]],
    not: &[FREE_SHAFT, SPEED_LOOP],
    run,
};

const IQ_A: [f64; 8] = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, -1.0, -3.0];
/// Length of a mean, s, and how many.
const MEAN_S: f64 = 10.0;
const MEANS: usize = 6;

/// The means of one current.
struct HeldTorque {
    torque: Vec<f64>,
    angle_deg: Vec<f64>,
    /// Torque of that current at the right angle and nominal flux, Nm.
    ideal: f64,
    /// Current and fault of a drive that has stopped itself.
    fault: Option<String>,
}

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let currents = IQ_A.map(|iq| context.config.amperes(iq));
    let mean_s = context.seconds.map_or(MEAN_S, |s| s / MEANS as f64);
    let held = context.in_parallel("torque-drift", &currents, |number, &iq| {
        hold(
            context,
            OperatingPoint { rpm: 0.0, iq, seed: context.seed.wrapping_add(number) },
            mean_s,
        )
    })?;

    let mut table = Table::new(
        "A minute at standstill",
        &["iq (A)", "torque (Nm)", "of the ideal", "torque drift (%)", "angle (°)", "drift (°)"],
    )
    .note("Means of ten seconds; the drift is the farthest of them from the first.");
    let (mut linear_2a, mut linear_3a) = (0.0_f64, 0.0_f64);
    let (mut torque_drift, mut angle_drift) = (0.0_f64, 0.0_f64);
    for (&iq, h) in currents.iter().zip(&held) {
        let off =
            |means: &[f64]| means.iter().map(|mean| (mean - means[0]).abs()).fold(0.0, f64::max);
        let torque = Stats::of(h.torque.iter().copied()).mean();
        let linear = 100.0 * (torque / h.ideal - 1.0).abs();
        linear_3a = linear_3a.max(linear);
        if iq.abs() <= context.config.amperes(2.0) {
            linear_2a = linear_2a.max(linear);
        }
        let percent = 100.0 * off(&h.torque) / h.torque[0].abs();
        torque_drift = torque_drift.max(percent);
        angle_drift = angle_drift.max(off(&h.angle_deg));
        table.row([
            Cell::fixed(iq, 1),
            Cell::fixed(torque, 4),
            Cell::fixed(torque / h.ideal, 4),
            Cell::fixed(percent, 2),
            Cell::fixed(h.angle_deg[0], 2),
            Cell::fixed(off(&h.angle_deg), 2),
        ]);
    }
    let mut outcome = Outcome::default();
    outcome.faults.extend(held.iter().filter_map(|h| h.fault.clone()));
    let m = &mut outcome.metrics;
    m.set("torque_error_to_2a_pct", linear_2a);
    m.set("torque_error_to_3a_pct", linear_3a);
    m.set("torque_drift_pct", torque_drift);
    m.set("angle_drift_deg", angle_drift);
    outcome.tables.push(table);
    let mut panel = Panel::new("time (s)", "torque over that of the first mean");
    for (iq, h) in currents.iter().zip(&held) {
        let line = h.torque.iter().enumerate();
        let line = line.map(|(n, t)| ((n as f64 + 0.5) * mean_s, t / h.torque[0])).collect();
        panel = panel.with(Series::line(format!("{iq} A"), line));
    }
    outcome
        .figures
        .push(Figure::new("drift", "Torque over a minute at standstill", "").panel(panel));
    outcome.remarks = assumptions(context.config);
    Ok(outcome)
}

fn hold(context: &Context<'_>, case: OperatingPoint, mean_s: f64) -> Result<HeldTorque, Error> {
    let mut rig = at_speed(context.config, case)?;
    rig.run(1.0, |_| {});
    let mut held =
        HeldTorque { torque: Vec::new(), angle_deg: Vec::new(), ideal: 0.0, fault: None };
    let (id, lm) = (f64::from(context.config.drive.i_d()), context.config.motor.l_m);
    for _ in 0..MEANS {
        let (mut torque, mut angle) = (Stats::default(), Stats::default());
        rig.run(mean_s, |p| {
            torque.push(p.torque);
            angle.push(p.angle_error_deg);
            held.ideal = p.torque_per_flux_ampere * lm * id * case.iq;
        });
        held.torque.push(torque.mean());
        held.angle_deg.push(angle.mean());
    }
    held.fault = rig.fault().map(|fault| format!("{} A: {fault}", case.iq));
    Ok(held)
}
