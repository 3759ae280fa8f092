//! The verdict on the runs, for each kind and region.

use super::case::Case;
use crate::experiments::battery::Summary;
use crate::experiments::course::{Refused, Trial};
use crate::prelude::*;

/// A run with its case and number.
pub type Done = (Case, usize, Trial);

/// The verdict on some runs: names in the metrics, heads of the columns, numbers, and decimals if they are not counts.
fn verdict(runs: &[&Trial]) -> Vec<(&'static str, &'static str, f64, Option<usize>)> {
    let started = || runs.iter().copied().filter(|run| run.refused.is_none());
    let (all, error) = (Summary::of(runs.iter().copied()), Summary::of(started()).error());
    let count = |is: fn(&Trial) -> bool| all.count(is) as f64;
    // Not a number if no run has started.
    let largest = |of: fn(&Trial) -> f64| started().map(of).fold(f64::NAN, f64::max);
    let least_v = started().map(|run| run.dc_link_v.0).fold(f64::NAN, f64::min);
    let largest_deg = if error.count() > 0 { error.largest() } else { f64::NAN };
    let took_s = started().filter_map(|run| run.took_s).reduce(f64::max);
    vec![
        ("runs", "runs", runs.len() as f64, None),
        ("lost_runs", "lost", count(Trial::is_lost_or_stopped), None),
        ("refused_runs", "refused", count(|run| run.refused.is_some()), None),
        ("stopped_runs", "stopped", count(|run| run.trip.is_some()), None),
        ("silent_runs", "silent", count(Trial::is_wrong), None),
        ("angle_error_rms_deg", "rms (°)", error.rms(), Some(2)),
        ("angle_error_max_deg", "largest (°)", largest_deg, Some(2)),
        ("current_peak_a", "current (A)", largest(|run| run.peak_a), Some(2)),
        ("dc_link_max_v", "most (V)", largest(|run| run.dc_link_v.1), Some(0)),
        ("dc_link_min_v", "dc link, least (V)", least_v, Some(0)),
        ("took_s", "took (s)", took_s.unwrap_or(f64::NAN), Some(2)),
    ]
}

/// Adds metrics, table and failures of all runs.
pub fn of(cases: &[Case], done: &[Done], outcome: &mut Outcome) {
    let mut table = Table::new("By kind and region", &[]);
    for case in cases {
        let of_case = done.iter().filter(|(of, _, _)| of == case);
        let some: Vec<&Trial> = of_case.map(|(_, _, run)| run).collect();
        if some.is_empty() {
            continue;
        }
        let mut verdict = verdict(&some);
        for (name, _, value, _) in &verdict {
            if *name != "took_s" || value.is_finite() {
                outcome.metrics.set(format!("{}_{name}", case.name()), *value);
            }
        }
        let torque = Stats::of(some.iter().filter_map(|run| run.torque_error));
        if torque.count() > 0 {
            let name = format!("{}_torque_error_mean_pct", case.name());
            outcome.metrics.set(name, 100.0 * torque.mean());
        }
        // In the table the lowest voltage stands before the highest.
        verdict.swap(8, 9);
        let cell = |value: f64, decimals: Option<usize>| match decimals {
            None => Cell::from(value.to_string()),
            Some(decimals) => Cell::fixed_or_dash(value, decimals),
        };
        let cells = verdict.into_iter().map(|(_, head, value, digits)| (head, cell(value, digits)));
        table.record([("kind", Cell::from(case.words()))].into_iter().chain(cells));
    }
    let (all, m) = (Summary::of(done.iter().map(|(_, _, run)| run)), &mut outcome.metrics);
    m.set("runs", done.len() as f64);
    m.set("lost_runs", all.count(Trial::is_lost_or_stopped) as f64);
    m.set("refused_runs", all.count(|run| run.refused.is_some()) as f64);
    m.set("silent_runs", all.count(Trial::is_wrong) as f64);
    outcome.tables.push(table);
    outcome.faults.extend(done.iter().filter_map(|(case, number, run)| {
        let reason = failure(case, run)?;
        let Trial { seed, rpm, i_q, .. } = run;
        let drawn = format!("{rpm:.0} rpm, {i_q:.2} A, seed {seed}");
        Some(format!("run {number}, {}: {drawn}: {reason}", case.words()))
    }));
}

/// Speed of the shaft above which a flying start is refused, rpm on four poles.
const CAUGHT_RPM: f64 = 2700.0;

/// Whether a flying start was refused because the shaft turns too fast: it counts in the table, but is no failure.
fn too_fast(case: &Case, run: &Trial) -> bool {
    let turning = matches!(case.kind, RangeKind::TurningStart | RangeKind::ResidualStart);
    turning
        && run.rpm.abs() > CAUGHT_RPM
        && run.refused == Some(Refused::Start(Fault::NotCaught.code()))
}

/// Returns the reason why a run is a failure.
fn failure(case: &Case, run: &Trial) -> Option<String> {
    if let Some(why) = &run.refused {
        return (!too_fast(case, run)).then(|| format!("not started: {why}"));
    }
    let reasons = [
        run.is_wrong().then(|| format!("beyond 45° for {:.2} s", run.wrong_s)),
        run.is_lost_or_stopped().then(|| match run.trip {
            Some(fault) => format!("fault {fault}, largest error {:.0}°", run.largest_deg),
            None => format!("largest error {:.0}°", run.largest_deg),
        }),
    ];
    let reason = reasons.into_iter().flatten().collect::<Vec<_>>().join(", ");
    (!reason.is_empty()).then_some(reason)
}

/// Draws the curves of one run.
pub fn figure(points: &[Point]) -> Figure {
    let panel = |label: &str, of: fn(&Point) -> f64| {
        let line = points.iter().map(|p| (p.t, of(p))).filter(|(_, y)| y.is_finite());
        Panel::new("time (s)", label).with(Series::line("run", line.collect()))
    };
    let error_deg = |p: &Point| if p.regulates { p.angle_error_deg } else { f64::NAN };
    Figure::new("run", "One run", "")
        .panel(panel("angle error (°)", error_deg))
        .panel(panel("speed (rpm)", |p| p.speed_rpm))
        .panel(panel("torque (Nm)", |p| p.torque))
        .panel(panel("current (A)", |p| p.current))
        .panel(panel("rotor flux (Wb)", |p| p.flux))
        .panel(panel("dc link (V)", |p| p.dc_link))
}
