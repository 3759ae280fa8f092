//! Position control without an encoder: the step of section 4.1, and the drift of the position.

use super::learning;
use super::scenario::{Metric, Record, Statistic, position_step};
use crate::prelude::*;
use crate::stats::StraightLine;

/// Duration of the step, s: long enough for both drives to arrive.
const STEP_S: f64 = 6.0;
/// Time over which the position is held for the drift, s.
const HOLD_S: f64 = 60.0;
/// Loads under which the position is held, Nm.
const LOADS_NM: [f64; 5] = [0.0, 0.3, -0.3, 0.6, -0.6];
/// True rotor resistance divided by the one the drive assumes, and whether the drive has done the saliency
/// self-commissioning with this wrong resistance and a locked shaft. Otherwise it uses its default, learned with the
/// right resistance.
const BELIEFS: [(f64, bool); 4] = [(1.0, false), (1.01, false), (1.1, false), (1.1, true)];

/// A load, Nm, and the assumptions of the drive.
type Case = (f64, (f64, bool));

/// A position held under a load.
#[derive(Default)]
struct HeldPosition {
    load_nm: f64,
    belief: (f64, bool),
    /// Time and mechanical degrees, ten points per second.
    track: Vec<(f64, f64)>,
    /// Mean q-axis current, A.
    iq: f64,
    angle_error: Stats,
    fault: Option<String>,
}

impl HeldPosition {
    /// Slope of a straight line through the track, degrees per minute.
    fn drift(&self) -> f64 {
        60.0 * StraightLine::through(&self.track).slope
    }

    /// Deviation from that line, degrees rms.
    fn wander(&self) -> f64 {
        let slope = self.drift() / 60.0;
        Stats::of(self.track.iter().map(|(t, x)| x - slope * t)).deviation()
    }
}

/// Holds position zero for some seconds, after the load has settled.
fn hold(config: &Config, seed: u64, case: Case, seconds: f64) -> Result<HeldPosition, Error> {
    let ((load_nm, belief), mut config) = (case, config.clone());
    config.drive.angle_source = AngleSource::Injection;
    config.load.mode = LoadMode::Free;
    config.load.torque_nm = None;
    config.motor.r_r = f64::from(config.drive.motor.r_r) * belief.0;
    let mut drive = config.drive;
    if belief.1 {
        drive.injection.synchronous.reference = Some(learning::learned(&config, seed)?.reference);
    }
    let mut rig = Rig::new(&plant_settings(&config), &drive, seed)?;
    rig.start(Mode::Position)?;
    rig.set_load(Load::Free { torque: load_nm })?;
    rig.wait(3.0);
    let start = rig.time();
    let origin = rig.plant.mechanical_angle() / TAU;
    let mut held = HeldPosition { load_nm, belief, ..HeldPosition::default() };
    let (mut iq, mut period) = (Stats::default(), 0_u32);
    rig.run(seconds, |p| {
        iq.push(p.iq);
        held.angle_error.push(p.angle_error_deg);
        if period.is_multiple_of(600) {
            held.track.push((p.t - start, (p.turns - origin) * 360.0));
        }
        period += 1;
    });
    held.iq = iq.mean();
    held.fault = rig.fault();
    Ok(held)
}

/// Runs the experiment, the objective that section 5.2 states.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let (config, seed) = (context.config, context.seed);
    let step_s = context.seconds.unwrap_or(STEP_S);
    let [with, without] = [true, false].map(|encoder| position_step(context, encoder, step_s));
    let (with, without) = (with?, without?);

    let hold_s = context.seconds.unwrap_or(HOLD_S);
    let loads = LOADS_NM.map(|nm| context.config.newton_metres(nm));
    let cases: Vec<Case> = BELIEFS.iter().flat_map(|&b| loads.map(|load| (load, b))).collect();
    let held = context.in_parallel("sensorless-position", &cases, |number, &case| {
        hold(config, seed.wrapping_add(number), case, hold_s)
    })?;

    let mut outcome = Outcome::default();
    for (record, which) in [(&with, "with the encoder"), (&without, "without it")] {
        outcome.faults.extend(record.fault.iter().map(|fault| format!("{which}: {fault}")));
    }
    for HeldPosition { load_nm, fault, .. } in &held {
        let text = |fault| format!("held under {load_nm} Nm: {fault}");
        outcome.faults.extend(fault.as_ref().map(text));
    }
    let m = &mut outcome.metrics;
    for (record, suffix) in [(&without, ""), (&with, "_encoder")] {
        let mut set = |name: &str, unit: &str, of: &str, statistic: Statistic| {
            // It has arrived when it is within one mechanical degree.
            let metric = Metric { within: 1.0 / 360.0, ..Metric::of(name, of, statistic) };
            m.set(format!("{name}{suffix}_{unit}"), record.statistic(&metric));
        };
        set("overshoot", "pct", "position_turns", Statistic::Overshoot);
        set("settling", "s", "reference_error", Statistic::Settling);
        set("final_error", "deg", "position_error_deg", Statistic::Last);
        set("angle_error", "rms_deg", "angle_error_deg", Statistic::Rms);
        set("angle_error", "max_deg", "angle_error_deg", Statistic::Largest);
        let estimate = ("position_estimate_error", "position_estimate_error_deg");
        set(estimate.0, "max_deg", estimate.1, Statistic::Largest);
    }
    let of = |belief: (f64, bool)| held.iter().filter(move |h| h.belief == belief);
    let drift = |belief| of(belief).map(|h| h.drift().abs()).fold(0.0, f64::max);
    m.set("drift_no_load_deg_per_min", held[0].drift());
    m.set("drift_max_deg_per_min", drift(BELIEFS[0]));
    // The part that is odd in the load: the error of the assumed rotor resistance.
    let per_ampere = |belief| {
        let sum = |term: fn(&HeldPosition) -> f64| of(belief).map(term).sum::<f64>();
        sum(|h| h.drift() * h.iq) / sum(|h| h.iq * h.iq)
    };
    let base = per_ampere(BELIEFS[0]);
    m.set("drift_deg_per_min_a", base);
    m.set("drift_deg_per_min_a_per_pct_rr", (per_ampere(BELIEFS[2]) - base) / 10.0);
    m.set("drift_learned_deg_per_min_a", per_ampere(BELIEFS[3]));
    m.set("wander_deg", held[0].wander());
    let rest = without.points.iter().filter(|p| p.t > 4.0);
    m.set("iq_rest_rms_a", Stats::of(rest.map(|p| p.iq_ref)).rms());
    m.set("stopped_runs", held.iter().filter(|h| h.fault.is_some()).count() as f64);

    let columns = columns![|_, h: &HeldPosition|
        "load (Nm)" => Cell::fixed(h.load_nm, 1);
        "r_r, true over believed" => Cell::fixed(h.belief.0, 2);
        "learned so" => Cell::from(if h.belief.1 { "yes" } else { "no" });
        "mean iq (A)" => Cell::fixed(h.iq, 2);
        "drift (°/min)" => Cell::fixed(h.drift(), 1);
        "beside it (° rms)" => Cell::fixed(h.wander(), 2);
        "angle error rms (°)" => Cell::fixed(h.angle_error.rms(), 2);
    ];
    let table = texts::table("sensorless-position", "drift");
    outcome.tables.push(Table::of(table, &columns, held.iter().enumerate()));
    outcome.figures.push(step_figure(&without, &with));
    outcome.figures.push(drift_figure(&held));
    Ok(outcome)
}

fn step_figure(without: &Record, with: &Record) -> Figure {
    let panel = |label: &str, of: &str| {
        let line = |record: &Record| record.means(of);
        Panel::new("time (s)", label)
            .with(Series::line("without encoder", line(without)))
            .with(Series::line("with encoder", line(with)))
    };
    texts::figure("sensorless-position", "step")
        .panel(panel("position (° mechanical)", "position_deg"))
        .panel(panel("seen − true (° mechanical)", "position_estimate_error_deg"))
        .panel(panel("speed (rpm)", "speed_rpm"))
        .panel(panel("quadrature current (A)", "torque_current_a"))
        .panel(panel("flux angle error (° electrical)", "angle_error_deg"))
}

fn drift_figure(held: &[HeldPosition]) -> Figure {
    let mut figure = texts::figure("sensorless-position", "drift");
    for belief in BELIEFS {
        let pct = (belief.0 - 1.0) * 100.0;
        let learned = if belief.1 { ", learned" } else { "" };
        let label = format!("position, r_r +{pct:.0} %{learned} (°)");
        let mut panel = Panel::new("time (s)", label);
        for h in held.iter().filter(|h| h.belief == belief) {
            panel = panel.with(Series::line(format!("{} Nm", h.load_nm), h.track.clone()));
        }
        figure = figure.panel(panel);
    }
    figure
}
