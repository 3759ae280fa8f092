//! Identification of the plant of the angle estimation with the encoder as reference, and the controller designed for
//! it (section 3.11).

pub mod measure;
pub mod model;

use std::f64::consts::FRAC_2_PI;

use sim_bench::steady::{OperatingPoint, steady_run};

use crate::demodulators::demodulation::{BPF, Demodulation, LITERAL, RECTIFIED, SYNCHRONOUS};
use crate::demodulators::tracked;
use crate::injection_map::PP;
use crate::prelude::*;
use measure::Record;
use model::{Model, Pii, TABLE_6_A};

/// Row of Table 6 for which section 3.11 designs the controller: 1.5 A.
const DESIGN_ROW: usize = 2;
/// Step lengths, samples, and noise, %, with which the post-processing filter alone is identified.
const HOLDS: std::ops::RangeInclusive<usize> = 10..=20;
const NOISES: [f64; 7] = [0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0];
/// The printed zero, completed by the digit that seems to be missing.
const LIKELY_Z_S: f64 = 0.99;
/// Gain of band-pass and post-processing filter at dc.
const LEAK: f64 = 0.0100 * PP;

/// The demodulations whose angle plant is identified.
const DEMODULATIONS: [Demodulation; 3] = [LITERAL, RECTIFIED, SYNCHRONOUS];

/// Identification at one q-axis current.
struct IdentifiedPoint {
    record: Record,
    /// The models by equation error and by output error.
    models: [Model; 2],
    /// Signal per rad while the current is held, and after it has followed the angle.
    steps: [f64; 2],
}

/// Runs the experiment: Section 3.11.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let jobs: Vec<(&Demodulation, f64)> =
        DEMODULATIONS.iter().flat_map(|s| TABLE_6_A.iter().map(move |&iq| (s, iq))).collect();
    let points = context.in_parallel("angle-identification", &jobs, |_, &(demodulation, iq)| {
        let mut config = context.config.clone();
        config.drive.injection.demodulator = demodulation.0;
        let rig = || Rig::oriented(&config, context.seed, iq, 0.8);
        let (record, steps) = (measure::sequence(rig()?)?, measure::steps(rig()?)?);
        Ok(IdentifiedPoint { models: Model::identify(&record)?, record, steps })
    })?;
    let all = || DEMODULATIONS.iter().zip(points.chunks(TABLE_6_A.len()));

    let mut outcome = Outcome::default();
    for (demodulation, points) in all() {
        metrics(&mut outcome, demodulation, points);
    }
    outcome.tables.extend(all().map(|(s, points)| gains(s, points, context.config)));
    compared(&points, &mut outcome);
    let table = post_filter(context, &mut outcome)?;
    outcome.tables.push(table);
    let table = closed_loops(context, &points, &mut outcome)?;
    outcome.tables.push(table);
    outcome.figures.extend(all().map(|(s, points)| bode_figure(s, points)));
    let (literal, rest) = points.split_at(TABLE_6_A.len());
    let (least, most) = fits(&rest[..TABLE_6_A.len()]);
    let apart = literal.iter().enumerate().map(|(row, point)| distance(&point.models[1], row));
    let values = [
        ("distance", apart.fold(0.0, f64::max)),
        ("rectified_least", least),
        ("rectified_most", most),
    ];
    texts::add_remarks(&mut outcome, "angle-identification", &values);
    Ok(outcome)
}

fn metrics(outcome: &mut Outcome, demodulation: &Demodulation, points: &[IdentifiedPoint]) {
    let (m, demodulation) = (&mut outcome.metrics, demodulation.name());
    for (iq, p) in TABLE_6_A.iter().zip(points) {
        let name = |what: &str| format!("{demodulation}_{what}_iq_{iq}a");
        m.set(name("fit_pct"), p.models[1].fit(&p.record));
        m.set(name("static_gain_milli"), p.models[1].static_gain() * 1e3);
        m.set(name("held_gain_milli"), p.steps[0] * 1e3);
        m.set(name("slow_gain_milli"), p.steps[1] * 1e3);
    }
    let [held, slow] = points[DESIGN_ROW].steps;
    m.set(format!("{demodulation}_held_over_slow"), held / slow);
}

/// Makes the table of the measured and predicted gains of the axis alone, and of axis and current together.
fn gains(demodulation: &Demodulation, points: &[IdentifiedPoint], config: &Config) -> Table {
    let unit = |what: &str| format!("{what} ({} / rad)", demodulation.unit());
    let mut table = texts::table("angle-identification", demodulation.name());
    let (id, s) = (f64::from(config.drive.i_d()), plant_settings(config).saliency);
    let inductance = config.motor.l_ls + config.motor.l_lr; // near sigma L_s
    let carrier = f64::from(config.drive.carrier_v()) / (TAU * 600.0 * inductance);
    for (iq, p) in TABLE_6_A.iter().zip(points) {
        let length = id.hypot(*iq);
        let cos_2_gamma = (id * id - iq * iq) / (length * length);
        let flux_part = 2.0 * s.a_psi.abs();
        let current_part = -2.0 * s.b1 * length * cos_2_gamma;
        let scale = match demodulation.0 {
            DemodulatorKind::Rectified => 2f64.sqrt() * carrier * BPF * FRAC_2_PI * PP,
            _ => 1.0,
        };
        let predicted = match demodulation.0 {
            DemodulatorKind::Literal => [2f64.sqrt() * LEAK * iq, 0.0],
            _ => [scale * (flux_part + current_part), scale * flux_part],
        };
        let [held, slow] = p.steps;
        let ratio = if predicted[1] == 0.0 { "-".into() } else { Cell::fixed(held / slow, 2) };
        table.record([
            ("iq (A)".to_owned(), Cell::fixed(*iq, 1)),
            (unit("axis alone, identified"), Cell::fixed(p.models[1].static_gain() * 1e3, 1)),
            (unit("axis alone, step"), Cell::fixed(held * 1e3, 1)),
            (unit("predicted"), Cell::fixed(predicted[0] * 1e3, 1)),
            (unit("with the current, step"), Cell::fixed(slow * 1e3, 1)),
            (unit("predicted"), Cell::fixed(predicted[1] * 1e3, 1)),
            ("axis alone over with the current".to_owned(), ratio),
        ]);
    }
    table
}

fn bode_figure(demodulation: &Demodulation, points: &[IdentifiedPoint]) -> Figure {
    let hz = frequencies(1.0, 600.0, 120);
    let bode = Bode { hz: &hz, label: "frequency (Hz)", shown: |hz| hz };
    let models = TABLE_6_A.iter().zip(points).enumerate().flat_map(|(row, (iq, p))| {
        [(format!("{iq} A"), p.models[1]), (String::new(), Model::printed(row))]
    });
    // The signals are printed in thousandths.
    let scaled = |m: Model| move |w: f64| Model { k: m.k * 1e3, ..m }.response(w);
    let (mut gain, mut phase) = bode.panels(models.map(|(name, model)| (name, scaled(model))));
    for series in
        [&mut gain, &mut phase].into_iter().flat_map(|p| p.series.iter_mut().skip(1).step_by(2))
    {
        (series.style, series.like_previous) = (Style::Points, true);
        series.points = series.points.iter().step_by(6).copied().collect();
    }
    let (name, unit) = (demodulation.name(), demodulation.unit());
    let title = format!("{name}: identified, and Table 6 (points), gain in {unit} per rad");
    Figure::new(format!("bode_{name}"), title, "Figure 35").panel(gain).panel(phase)
}

/// Compares Table 6 and Eq. 3.44 with the results of the printed chain on the simulated motor, and with a design for the printed plant.
fn compared(points: &[IdentifiedPoint], outcome: &mut Outcome) {
    let unknown = "the length of the steps and the noise of its sequence";
    for (iq, point) in TABLE_6_A.iter().zip(points) {
        let model = point.models[1];
        let [pole, _] = model.poles();
        for (quantity, value) in [("k_phi", 1e5 * model.k), ("Re p", pole.re), ("Im p", pole.im)] {
            let ours = beside(&format!("Table 6, {iq:.1} A"), quantity).unknown(unknown);
            outcome.compared.push(ours.simulated(value));
        }
    }
    let plant = Model::printed(DESIGN_ROW);
    let largest = |pii: Pii| largest_pole(&plant.closed_loop(pii));
    let unstable = (0..TABLE_6_A.len())
        .filter(|row| largest_pole(&Model::printed(*row).closed_loop(Pii::printed())) > 1.0);
    outcome.metrics.set("table_6_printed_pii_unstable", unstable.count() as f64);
    let stable = Stats::of((0..TABLE_6_A.len()).map(|row| {
        largest_pole(&Model::printed(row).closed_loop(Pii { z_s: LIKELY_Z_S, ..Pii::printed() }))
    }));
    outcome.metrics.set("table_6_printed_pii_largest_pole", largest(Pii::printed()));
    outcome.metrics.set("table_6_z_s_099_largest_pole", stable.largest());
    if let Some((design, _)) = plant.design() {
        outcome.compared.push(beside("Eq. 3.44", "k_s").of_print(design.k_s));
        outcome.compared.push(beside("Eq. 3.44", "z_s").of_print(design.z_s));
    }
    let fit = fits(points.get(..TABLE_6_A.len()).unwrap_or_default());
    outcome.metrics.set("literal_fit_least_pct", fit.0);
    outcome.metrics.set("literal_fit_most_pct", fit.1);
    outcome.compared.push(named("two_poles_predict").simulated(fit.0 > 80.0));
    outcome.compared.push(named("pii_for_1_5_a").of_print(largest(Pii::printed()) < 1.0));
}

/// Finds, for each row of Table 6, the step length and the noise with which Appendix A gives its poles for the post-processing filter
/// alone, without a motor.
fn post_filter(context: &Context<'_>, outcome: &mut Outcome) -> Result<Table, Error> {
    let cases: Vec<(usize, f64)> =
        HOLDS.flat_map(|hold| NOISES.map(|percent| (hold, percent))).collect();
    let models = context.in_parallel("post filter", &cases, |_, &(hold, percent)| {
        Ok(Model::identify(&measure::filter_alone(hold, percent / 100.0, context.seed))?[0])
    })?;
    let mut table = texts::table("angle-identification", "post_filter");
    let mut largest = 0.0_f64;
    for (row, iq) in TABLE_6_A.iter().enumerate() {
        let off = |model: &Model| distance(model, row);
        let all = cases.iter().zip(&models);
        let Some(((hold, percent), model)) = all.min_by(|a, b| off(a.1).total_cmp(&off(b.1)))
        else {
            continue;
        };
        largest = largest.max(off(model));
        let [pole, _] = model.poles();
        table.record([
            ("row of Table 6 (A)", Cell::fixed(*iq, 1)),
            ("steps (samples)", Cell::fixed(*hold as f64, 0)),
            ("noise (%)", Cell::fixed(*percent, 1)),
            ("Re p", Cell::fixed(pole.re, 4)),
            ("Im p", Cell::fixed(pole.im, 4)),
        ]);
    }
    outcome.metrics.set("post_filter_distance", largest);
    Ok(table)
}

/// Runs controllers in the closed loop: over the steps of Figure 38, and at constant speed.
fn closed_loops(
    context: &Context<'_>,
    points: &[IdentifiedPoint],
    outcome: &mut Outcome,
) -> Result<Table, Error> {
    let design = |model: &Model| model.design().map(|(pii, _)| pii);
    let (literal, rectified) = (DESIGN_ROW, TABLE_6_A.len() + DESIGN_ROW);
    let likely = Pii { z_s: LIKELY_Z_S, ..Pii::printed() };
    let cases = [
        ("rectified", "its own plant", "designed", RECTIFIED, design(&points[rectified].models[1])),
        ("rectified", "printed", "printed", RECTIFIED, Some(Pii::printed())),
        ("rectified", "z_s = 0.99", "z_s_099", RECTIFIED, Some(likely)),
        ("rectified", "Table 6", "table_6", RECTIFIED, design(&Model::printed(DESIGN_ROW))),
        ("literal", "its own plant", "literal", LITERAL, design(&points[literal].models[1])),
    ];
    let runs = context.in_parallel("closed loops", &cases, |_, (.., demodulation, pii)| {
        let pii = pii.ok_or_else(|| Error::Refused("no controller fits the plant".to_owned()))?;
        let mut config = demodulation.config(context.config);
        let printed = &mut config.drive.injection.printed;
        (printed.k_s, printed.z_s) = (pii.k_s as f32, pii.z_s as f32);
        let at = |rpm| {
            let case = OperatingPoint { rpm, iq: TABLE_6_A[DESIGN_ROW], seed: context.seed };
            steady_run(&config, case, 1.0)
        };
        Ok((tracked::steps(&config, context.seed)?, [at(0.0)?, at(150.0)?], pii))
    })?;
    let mut table = texts::table("angle-identification", "controllers");
    for ((name, from, key, ..), (steps, turning, pii)) in cases.iter().zip(&runs) {
        let shown =
            |lost: bool, value: f64| if lost { "lost".into() } else { Cell::fixed(value, 1) };
        outcome.metrics.set(format!("pii_{key}_steps_lost"), f64::from(steps.lost));
        outcome.metrics.set(format!("pii_{key}_steps_rms_deg"), steps.stats.rms());
        table.record([
            ("chain", Cell::from(*name)),
            ("designed for", Cell::from(*from)),
            ("k_s (rad/A)", Cell::significant(pii.k_s, 3)),
            ("z_s", Cell::fixed(pii.z_s, 4)),
            ("Figure 38, rms (°)", shown(steps.lost, steps.stats.rms())),
            ("largest (°)", shown(steps.lost, steps.stats.largest())),
            ("0 rpm, rms (°)", shown(turning[0].lost, turning[0].error.rms())),
            ("150 rpm, rms (°)", shown(turning[1].lost, turning[1].error.rms())),
        ]);
    }
    Ok(table)
}

/// Smallest and largest fit of Eq. 3.43, %.
fn fits(points: &[IdentifiedPoint]) -> (f64, f64) {
    let fits = points.iter().map(|p| p.models[1].fit(&p.record));
    fits.fold((f64::MAX, f64::MIN), |(least, most), fit| (least.min(fit), most.max(fit)))
}

/// Distance of the poles of a model from those of a row of Table 6, in real or imaginary part.
fn distance(model: &Model, row: usize) -> f64 {
    let apart = model.poles()[0] - Model::printed(row).poles()[0];
    apart.re.abs().max(apart.im.abs())
}
