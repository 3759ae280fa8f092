//! Estimation of rotor time constant and speed from the terminals while the drive runs and its rotor warms up.

use std::ops::Range;

use rotor_id::online::RotorEstimate;

use crate::prelude::*;
use crate::warming_rotor::{WarmingCase, WarmingMoment, run as simulate};

/// Beginning and end of the warming, s, and the relative increase of r_r. This is fast: a motor takes minutes.
const WARMING: (f64, f64, f64) = (4.0, 10.0, 0.3);
const SECONDS: f64 = 18.0;
/// Time after which the estimate has settled again, s.
const SETTLED: f64 = 15.0;
/// Speed (rpm) and q-axis current (A).
#[rustfmt::skip] // pairs, side by side
const POINTS: [(f64, f64); 9] = [
    (0.0, 1.0), (0.0, 2.0), (30.0, 1.0), (150.0, 0.5), (150.0, 2.0), (150.0, 3.0), (-150.0, 2.0), (300.0, -1.0), (600.0, 1.0),
];
const SENSORLESS: [(f64, f64); 4] = [(0.0, 2.0), (150.0, 1.0), (150.0, 2.0), (300.0, 1.0)];
/// Variation of the magnetising current without an encoder, A and Hz.
const EXCITATION: (f64, f64) = (0.1, 2.0);
/// Shares of the dead-time voltage that remain uncompensated.
const RESIDUALS: [f64; 3] = [0.0, 0.2, 0.5];

/// The dead-time voltage: 2.2 us at 6 kHz of the dc link.
fn residual(config: &Config, share: f64) -> f64 {
    share * config.inverter.dc_link_v * config.inverter.dead_time_s * 6e3
}

/// Means over the end of a run.
struct FinalMeans {
    /// Mean error of tau_r (%) and of the speed (rad/s), and the share of the time with an estimate (%).
    tau_r: Option<f64>,
    speed: Option<f64>,
    valid: f64,
    /// Mean flux angle error, degrees.
    angle: f64,
    /// Mean error of the speed by Model D, rad/s.
    inverse_speed: Option<f64>,
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let stats = Stats::of(values);
    (stats.count() > 0).then(|| stats.mean())
}

fn ending(moments: &[WarmingMoment]) -> FinalMeans {
    let last: Vec<&WarmingMoment> = moments.iter().filter(|m| m.t > SETTLED).collect();
    let estimates: Vec<_> = last.iter().filter_map(|m| m.estimate.ok().map(|e| (m, e))).collect();
    let inverse = last.iter().filter_map(|m| m.model_d.omega_m.ok().map(|w| w - m.omega_m));
    FinalMeans {
        tau_r: mean(estimates.iter().map(|(m, e)| 100.0 * (f64::from(e.tau_r) / m.tau_r - 1.0))),
        speed: mean(estimates.iter().map(|(m, e)| f64::from(e.omega_m) - m.omega_m)),
        valid: 100.0 * estimates.len() as f64 / last.len().max(1) as f64,
        angle: mean(last.iter().map(|m| m.angle_error_deg)).unwrap_or(0.0),
        inverse_speed: mean(inverse),
    }
}

/// A run to be done: source, point, excitation, residual, and whether the drive uses the estimate.
type Job = (AngleSource, (f64, f64), (f64, f64), f64, bool);

fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    for point in POINTS {
        jobs.extend(RESIDUALS.map(|share| (AngleSource::Encoder, point, (0.0, 0.0), share, true)));
        jobs.push((AngleSource::Encoder, point, (0.0, 0.0), 0.5, false));
    }
    for point in SENSORLESS {
        jobs.extend(
            RESIDUALS.map(|share| (AngleSource::Injection, point, EXCITATION, share, true)),
        );
        jobs.push((AngleSource::Injection, point, (0.0, 0.0), 0.2, true));
    }
    jobs
}

/// Runs the experiment, which is not in the sources: the recursive estimate in operation.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let jobs = jobs();
    let runs = context.in_parallel("online-tracking", &jobs, |_, &job| {
        let (source, (speed_rpm, iq_a), excitation, share, used) = job;
        let mut config = context.config.clone();
        config.drive.angle_source = source;
        // The monitor knows only one magnetising current: with it the drive would refuse to change that current.
        config.drive.injection.synchronous.monitor = false;
        config.inverter.residual_v = Some(residual(&config, share));
        let (warming, seconds) = (WARMING, SECONDS);
        let case = WarmingCase { speed_rpm, iq_a, excitation, used, warming, seconds };
        simulate(&config, &case, context.seed)
    })?;
    let endings: Vec<FinalMeans> = runs.iter().map(|moments| ending(moments)).collect();
    let (encoder, sensorless) = endings.split_at(4 * POINTS.len());

    let mut outcome = Outcome::default();
    outcome.tables.push(with_encoder(encoder, &mut outcome.metrics));
    outcome.tables.push(without(sensorless, &mut outcome.metrics));
    let shown = 4 * POINTS.iter().position(|&p| p == (150.0, 2.0)).unwrap_or(0);
    outcome.figures.push(figure(&runs[shown + 2], &runs[shown + 3]));
    outcome.figures.push(speed_figure(&runs[4 * POINTS.len() + 10]));
    let residual_v = residual(context.config, 1.0);
    texts::add_remarks(&mut outcome, "online-tracking", &[("residual_v", residual_v)]);
    Ok(outcome)
}

fn number(value: Option<f64>, decimals: usize) -> Cell {
    value.map_or_else(|| Cell::from("too poor"), |value| Cell::fixed(value, decimals))
}

/// Largest magnitude of a quantity in some of the four runs of each point.
fn most(endings: &[FinalMeans], runs: Range<usize>, of: fn(&FinalMeans) -> f64) -> f64 {
    Stats::of(endings.chunks_exact(4).flat_map(|rows| &rows[runs.clone()]).map(of)).largest()
}

fn with_encoder(endings: &[FinalMeans], metrics: &mut Metrics) -> Table {
    let mut table = texts::table("online-tracking", "with_encoder");
    for (point, row) in POINTS.iter().zip(endings.chunks_exact(4)) {
        table.record([
            ("speed (rpm)", Cell::fixed(point.0, 0)),
            ("i_q (A)", Cell::fixed(point.1, 1)),
            ("error (%), all dead time compensated", number(row[0].tau_r, 1)),
            ("20 % of it left", number(row[1].tau_r, 1)),
            ("50 % left", number(row[2].tau_r, 1)),
            ("angle error (°), 50 % left", Cell::fixed(row[2].angle, 2)),
            ("without tracking (°)", Cell::fixed(row[3].angle, 2)),
        ]);
    }
    for (run, share) in RESIDUALS.iter().enumerate() {
        let name = format!("tau_r_error_max_residual_{:.0}_pct", 100.0 * share);
        metrics.set(name, most(endings, run..run + 1, |e| e.tau_r.unwrap_or(100.0)));
    }
    metrics.set("angle_error_max_deg", most(endings, 2..3, |e| e.angle));
    metrics.set("angle_error_untracked_max_deg", most(endings, 3..4, |e| e.angle));
    table
}

fn without(endings: &[FinalMeans], metrics: &mut Metrics) -> Table {
    let mut table = texts::table("online-tracking", "without");
    for (point, rows) in SENSORLESS.iter().zip(endings.chunks_exact(4)) {
        for (n, ending) in rows.iter().enumerate() {
            let left = RESIDUALS.get(n).map(|share| Cell::fixed(100.0 * share, 0));
            let left = left.unwrap_or_else(|| "20, not moved".into());
            table.record([
                ("speed (rpm)", Cell::fixed(point.0, 0)),
                ("i_q (A)", Cell::fixed(point.1, 1)),
                ("dead time left (%)", left),
                ("τ_r error (%)", number(ending.tau_r, 1)),
                ("speed error (rad/s)", number(ending.speed, 2)),
                ("there was an estimate (% of the time)", Cell::fixed(ending.valid, 0)),
                ("Model D's speed error (rad/s)", number(ending.inverse_speed, 1)),
            ]);
        }
    }
    let tau_r = most(endings, 0..3, |e| e.tau_r.unwrap_or(100.0));
    let speed = most(endings, 0..3, |e| e.speed.unwrap_or(100.0));
    metrics.set("sensorless_tau_r_error_max_pct", tau_r);
    metrics.set("sensorless_speed_error_max_rad_s", speed);
    // The last of the four runs is the one without variation.
    metrics.set("sensorless_not_moved_valid_max_pct", most(endings, 3..4, |e| e.valid));
    table
}

/// Draws an estimate beside the true value.
fn traced(
    label: &str,
    moments: &[WarmingMoment],
    estimate: fn(RotorEstimate) -> f32,
    truth: fn(&WarmingMoment) -> f64,
) -> Panel {
    let estimate = |m: &WarmingMoment| (m.t, m.estimate.map_or(f64::NAN, |e| estimate(e).into()));
    let truth = moments.iter().map(|m| (m.t, truth(m))).collect();
    Panel::new("time (s)", label)
        .with(Series::line("estimate", moments.iter().map(estimate).collect()))
        .with(Series::reference("motor", truth))
}

fn time_constant(moments: &[WarmingMoment]) -> Panel {
    traced("rotor time constant (s)", moments, |e| e.tau_r, |m| m.tau_r)
}

fn figure(used: &[WarmingMoment], unused: &[WarmingMoment]) -> Figure {
    let angle =
        |moments: &[WarmingMoment]| moments.iter().map(|m| (m.t, m.angle_error_deg)).collect();
    let error = Panel::new("time (s)", "flux angle error (° electrical)")
        .with(Series::line("tracked", angle(used)))
        .with(Series::line("not tracked", angle(unused)));
    texts::figure("online-tracking", "tracking").panel(time_constant(used)).panel(error)
}

fn speed_figure(moments: &[WarmingMoment]) -> Figure {
    texts::figure("online-tracking", "sensorless")
        .panel(traced("speed (electrical rad/s)", moments, |e| e.omega_m, |m| m.omega_m))
        .panel(time_constant(moments))
}
