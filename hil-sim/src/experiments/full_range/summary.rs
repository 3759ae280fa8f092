//! The verdict over the runs, per kind and region.

use super::case::Case;
use crate::config::RangeKind;
use crate::experiments::battery::{Moment, Refused, Trial, UNNOTICED_S};
use crate::prelude::*;

/// The meaning of the columns.
pub const REMARK: &str = "Error: true minus estimated, over all samples that count: at constant torque and in reversals from 0.5 s \
    after the first torque on, after a start on a turning shaft from 0.1 s to 0.7 s after the torque, until the flux is turned, and \
    otherwise from the end of the run-up on. Lost: stopped by a fault, or beyond 45° at any time; a turned flux may end in a stop. \
    Refused: not started; no failure where the shaft turns too fast to be caught (fault 47). \
    Silent: beyond 45° for more than 0.5 s while the drive regulates. Current: the largest of a phase, carrier included. Took: until \
    a turning shaft was caught, or a braked one stood.";

/// Lost: stopped by a fault, or beyond 45°; after a turn of the flux neither counts.
fn is_lost(case: &Case, run: &Trial) -> bool {
    run.trip.is_some() && case.kind != RangeKind::TurnedFlux || run.is_lost()
}

/// The verdict on some runs.
struct Verdict {
    runs: usize,
    lost: usize,
    refused: usize,
    stopped: usize,
    silent: usize,
    error: Stats,
    peak_a: f64,
    dc_link_v: (f64, f64),
    took_s: Option<f64>,
}

impl Verdict {
    fn of(done: &[&(Case, usize, Trial)]) -> Self {
        let count = |is: &dyn Fn(&Case, &Trial) -> bool| {
            done.iter().filter(|(case, _, run)| is(case, run)).count()
        };
        let started = || done.iter().map(|(_, _, run)| run).filter(|run| run.refused.is_none());
        let mut error = Stats::default();
        started().for_each(|run| error.add(&run.error));
        Self {
            runs: done.len(),
            lost: count(&|case, run| is_lost(case, run)),
            refused: count(&|_, run| run.refused.is_some()),
            stopped: count(&|_, run| run.trip.is_some()),
            silent: count(&|_, run| run.wrong_s > UNNOTICED_S),
            error,
            // Not a number where none has started.
            peak_a: started().map(|run| run.peak_a).fold(f64::NAN, f64::max),
            dc_link_v: started().fold((f64::NAN, f64::NAN), |(least, most), run| {
                (least.min(run.dc_link_v.0), most.max(run.dc_link_v.1))
            }),
            took_s: started().filter_map(|run| run.took_s).reduce(f64::max),
        }
    }
}

impl Verdict {
    /// Largest error; not a number without samples.
    fn largest_deg(&self) -> f64 {
        if self.error.count() > 0 { self.error.largest() } else { f64::NAN }
    }
}

/// Metrics, table and failures of all runs, each with its case and number.
pub fn of(cases: &[Case], done: &[(Case, usize, Trial)], outcome: &mut Outcome) {
    let mut table = Table::new("By kind and region", &[]);
    for case in cases {
        let some: Vec<_> = done.iter().filter(|(of, _, _)| of == case).collect();
        if some.is_empty() {
            continue;
        }
        let (verdict, name) = (Verdict::of(&some), case.name());
        let m = &mut outcome.metrics;
        let mut set = |what: &str, value: f64| m.set(format!("{name}_{what}"), value);
        set("runs", verdict.runs as f64);
        set("lost_runs", verdict.lost as f64);
        set("refused_runs", verdict.refused as f64);
        set("stopped_runs", verdict.stopped as f64);
        set("silent_runs", verdict.silent as f64);
        set("angle_error_rms_deg", verdict.error.rms());
        set("angle_error_max_deg", verdict.largest_deg());
        set("current_peak_a", verdict.peak_a);
        set("dc_link_max_v", verdict.dc_link_v.1);
        set("dc_link_min_v", verdict.dc_link_v.0);
        if let Some(longest) = verdict.took_s {
            set("took_s", longest);
        }
        table.record([("kind", Cell::from(case.words()))].into_iter().chain(cells(&verdict)));
    }
    let all = Verdict::of(&done.iter().collect::<Vec<_>>());
    for (name, count) in [
        ("runs", all.runs),
        ("lost_runs", all.lost),
        ("refused_runs", all.refused),
        ("silent_runs", all.silent),
    ] {
        outcome.metrics.set(name, count as f64);
    }
    outcome.tables.push(table);
    outcome.faults.extend(done.iter().filter_map(|(case, number, run)| {
        let reason = failure(case, run)?;
        let Trial { seed, rpm, i_q, .. } = run;
        let drawn = format!("{rpm:.0} rpm, {i_q:.2} A, seed {seed}");
        Some(format!("run {number}, {}: {drawn}: {reason}", case.words()))
    }));
}

fn cells(verdict: &Verdict) -> Vec<(&'static str, Cell)> {
    let number = |value: f64, n| Cell::or_dash(value.is_finite().then(|| Cell::fixed(value, n)));
    let count = |count: usize| Cell::from(count.to_string());
    vec![
        ("runs", count(verdict.runs)),
        ("lost", count(verdict.lost)),
        ("refused", count(verdict.refused)),
        ("stopped", count(verdict.stopped)),
        ("silent", count(verdict.silent)),
        ("rms (°)", number(verdict.error.rms(), 2)),
        ("largest (°)", number(verdict.largest_deg(), 2)),
        ("current (A)", number(verdict.peak_a, 2)),
        ("dc link, least (V)", number(verdict.dc_link_v.0, 0)),
        ("most (V)", number(verdict.dc_link_v.1, 0)),
        ("took (s)", number(verdict.took_s.unwrap_or(f64::NAN), 2)),
    ]
}

/// Speed of the shaft beyond which a start refuses to follow it, rpm on four poles.
const CAUGHT_RPM: f64 = 2700.0;

/// The refusal of a shaft that turns too fast to be caught: a number of the table, and no failure.
fn too_fast(case: &Case, run: &Trial) -> bool {
    let turning = matches!(case.kind, RangeKind::TurningStart | RangeKind::ResidualStart);
    turning
        && run.rpm.abs() > CAUGHT_RPM
        && run.refused == Some(Refused::Start(Fault::NotCaught.code()))
}

/// Why a run is none that a drive should have.
fn failure(case: &Case, run: &Trial) -> Option<String> {
    if let Some(why) = &run.refused {
        return (!too_fast(case, run)).then(|| format!("not started: {why}"));
    }
    let reasons = [
        (run.wrong_s > UNNOTICED_S).then(|| format!("beyond 45° for {:.2} s", run.wrong_s)),
        is_lost(case, run).then(|| match run.trip {
            Some(fault) => format!("fault {fault}, largest error {:.0}°", run.largest_deg),
            None => format!("largest error {:.0}°", run.largest_deg),
        }),
    ];
    let reason = reasons.into_iter().flatten().collect::<Vec<_>>().join(", ");
    (!reason.is_empty()).then_some(reason)
}

/// The record of one run.
pub fn figure(moments: &[Moment]) -> Figure {
    let panel = |label: &str, of: fn(&Moment) -> f64| {
        let points = moments.iter().map(|m| (m.t, of(m))).filter(|(_, y)| y.is_finite());
        Panel::new("time (s)", label).with(Series::line("run", points.collect()))
    };
    Figure::new("run", "One run", "")
        .panel(panel("angle error (°)", |m| m.error_deg))
        .panel(panel("speed (rpm)", |m| m.rpm))
        .panel(panel("torque (Nm)", |m| m.torque))
        .panel(panel("current (A)", |m| m.current))
        .panel(panel("rotor flux (Wb)", |m| m.flux.norm()))
        .panel(panel("dc link (V)", |m| m.dc_link))
}
