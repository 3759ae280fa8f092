//! The plant of the angle estimation, identified with the encoder as reference, and the controller made
//! from it (section 3.11).

mod measure;
mod model;

use std::f64::consts::{FRAC_2_PI, TAU};

use drive_core::carrier::DemodulatorKind;
use num_complex::Complex64;
use sim_bench::bode::{Bode, frequencies, largest_pole, roots};
use sim_bench::prelude::*;

use crate::demodulators::demodulation::{BPF, Demodulation, LITERAL, RECTIFIED, SYNCHRONOUS};
use crate::injection_map::PP;
use measure::{Record, SLOW, StepResponses};
use model::{Model, PRINTED_PII, Pii, TABLE_6};

/// Section 3.11.
pub const EXPERIMENT: Experiment = Experiment {
    name: "angle-identification",
    stands_for: "Figures 33, 34, 35, Table 6, Eq. 3.43, 3.44",
    about: "The plant of the angle estimation by a pseudo-random sequence on the injection angle, the \
            controller made from it, and why the loop is closed around another plant.",
    uses: &[BENCH, DRIVE],
    not: &[FREE_SHAFT, SPEED_LOOP, &["angle_source"]],
    run,
};

/// Row of Table 6 for which section 3.11 designs the controller: 1.5 A.
const DESIGN_ROW: usize = 2;
/// The printed zero with the digit that seems to be lost.
const LIKELY_PII: Pii = Pii { z_s: 0.99, ..PRINTED_PII };
/// Gain of band-pass and post-processing filter at dc.
const LEAK: f64 = 0.0100 * PP;

/// The demodulations whose angle plant is identified.
const DEMODULATIONS: [Demodulation; 3] = [LITERAL, RECTIFIED, SYNCHRONOUS];

/// Identification at one torque current.
struct IdentifiedPoint {
    record: Record,
    /// By equation error and by output error.
    models: [Model; 2],
    steps: StepResponses,
}

impl IdentifiedPoint {
    /// Signal per rad once the current has followed the angle.
    fn slow_gain(&self) -> f64 {
        self.steps.with_current[SLOW].iter().sum::<f64>() / SLOW.len() as f64
    }

    /// Signal per rad, the current held.
    fn held_gain(&self) -> f64 {
        self.steps.alone[SLOW].iter().sum::<f64>() / SLOW.len() as f64
    }
}

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let jobs: Vec<(&Demodulation, f64)> =
        DEMODULATIONS.iter().flat_map(|s| TABLE_6.iter().map(move |row| (s, row.0))).collect();
    let points = context.in_parallel("angle-identification", &jobs, |_, &(demodulation, iq)| {
        let (config, seed) = (context.config, context.seed);
        let record = measure::sequence(config, demodulation.demodulator, iq, seed)?;
        let steps = measure::steps(config, demodulation.demodulator, iq, seed)?;
        Ok(IdentifiedPoint { models: Model::identify(&record)?, record, steps })
    })?;
    let all = || DEMODULATIONS.iter().zip(points.chunks(TABLE_6.len()));

    let mut outcome = Outcome::default();
    for (demodulation, points) in all() {
        outcome.tables.push(identified(demodulation, points));
        metrics(&mut outcome, demodulation, points);
    }
    outcome.tables.extend(all().map(|(s, points)| gains(s, points, context.config)));
    outcome.tables.push(controllers(all()));
    outcome.figures.extend(all().map(|(s, points)| fit_figure(s, &points[DESIGN_ROW])));
    outcome.figures.extend(all().map(|(s, points)| bode_figure(s, points)));
    outcome.figures.extend(all().map(|(s, points)| step_figure(s, points)));
    outcome.figures.push(poles_figure(&points));
    outcome.remarks = remarks(&points);
    outcome.remarks.extend(assumptions(context.config));
    Ok(outcome)
}

fn metrics(outcome: &mut Outcome, demodulation: &Demodulation, points: &[IdentifiedPoint]) {
    let m = &mut outcome.metrics;
    for ((iq, ..), p) in TABLE_6.iter().zip(points) {
        let name = |what: &str| format!("{}_{what}_iq_{iq}a", demodulation.name);
        m.set(name("fit_pct"), p.models[1].fit(&p.record).1);
        m.set(name("static_gain_milli"), p.models[1].static_gain() * 1e3);
        m.set(name("held_gain_milli"), p.held_gain() * 1e3);
        m.set(name("slow_gain_milli"), p.slow_gain() * 1e3);
    }
}

fn complex(pole: Complex64) -> String {
    format!("{:.4} {} j{:.4}", pole.re, if pole.im < 0.0 { '-' } else { '+' }, pole.im.abs())
}

fn poles_text(model: &Model) -> String {
    match model.poles() {
        [p, _] if p.im != 0.0 => format!("{:.4} ± j{:.4}", p.re, p.im.abs()),
        [p, q] => format!("{}, {}", complex(p), complex(q)),
    }
}

fn identified(demodulation: &Demodulation, points: &[IdentifiedPoint]) -> Table {
    let gain = format!("static gain ({} / rad)", demodulation.unit());
    let title = format!("Eq. 3.43 for {}, beside Table 6", demodulation.name);
    let mut table = Table::new(title, &[]).note(
        "Least squares of the output error (Steiglitz and McBride); the last column is what the one-step \
         least squares of Appendix A fits, which with noise on the output shifts poles and gain. Fit: \
         100 % less rms error over rms signal, of the simulated output.",
    );
    for (row, p) in points.iter().enumerate() {
        let [equation, model] = &p.models;
        let printed = Model::printed(row);
        table.record([
            ("iq (A)", Cell::fixed(TABLE_6[row].0, 1)),
            ("k_φ × 10⁵", Cell::fixed(model.k * 1e5, 3)),
            ("printed", Cell::fixed(printed.k * 1e5, 3)),
            ("ratio", Cell::fixed(model.k / printed.k, 2)),
            ("poles", Cell::from(poles_text(model))),
            ("printed poles", Cell::from(poles_text(&printed))),
            (&gain, Cell::fixed(model.static_gain() * 1e3, 1)),
            ("printed (mA/rad)", Cell::fixed(printed.static_gain() * 1e3, 1)),
            ("ratio of gains", Cell::fixed(model.static_gain() / printed.static_gain(), 2)),
            ("fit (%)", Cell::fixed(model.fit(&p.record).1, 1)),
            ("fit of equation error (%)", Cell::fixed(equation.fit(&p.record).1, 1)),
        ]);
    }
    table
}

/// The gains of the axis alone and of axis and current together, measured and predicted.
fn gains(demodulation: &Demodulation, points: &[IdentifiedPoint], config: &Config) -> Table {
    let unit = |what: &str| format!("{what} ({} / rad)", demodulation.unit());
    let title = format!("Two plants: {}", demodulation.name);
    let mut table = Table::new(title, &[]).note(match demodulation.demodulator {
            DemodulatorKind::Literal => {
                "Predicted: the leak of the fundamental, −√2 0.01 0.944 |i| sin(x + γ) with x the \
                 axis seen from the current's frame: slope √2 0.00944 iq while the current is held; \
                 none when the current turns with the axis. The loop is closed around the second: it \
                 has no gain."
            }
            DemodulatorKind::Synchronous => {
                "Predicted: q = −Im(s e^(−2jθ)) with s = a e^(2jφ̂₂) + b |i| e^(2j arg i): slope \
                 2(|a| − b |i| cos 2γ) while the current is held, 2|a| once it has turned with the \
                 axis. The first is what a fast error meets and what section 3.11 identifies; the second \
                 is what a slow error meets."
            }
            _ => {
                "Predicted: the slopes of the saliency (see synchronous) times √2 |I_hf| and the gain \
                 of the chain, 0.945 2/π 0.944."
            }
        });
    let (id, s) = (f64::from(config.drive.i_d()), plant_settings(config).saliency);
    let inductance = config.motor.l_ls + config.motor.l_lr; // near sigma L_s
    let carrier = f64::from(config.drive.carrier_v()) / (TAU * 600.0 * inductance);
    for ((iq, ..), p) in TABLE_6.iter().zip(points) {
        let length = id.hypot(*iq);
        let cos_2_gamma = (id * id - iq * iq) / (length * length);
        let flux_part = 2.0 * s.a_psi.abs();
        let current_part = -2.0 * s.b1 * length * cos_2_gamma;
        let scale = match demodulation.demodulator {
            DemodulatorKind::Rectified => 2f64.sqrt() * carrier * BPF * FRAC_2_PI * PP,
            _ => 1.0,
        };
        let predicted = match demodulation.demodulator {
            DemodulatorKind::Literal => [2f64.sqrt() * LEAK * iq, 0.0],
            _ => [scale * (flux_part + current_part), scale * flux_part],
        };
        let (held, slow) = (p.held_gain(), p.slow_gain());
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

/// The controllers on the identified plants.
fn controllers<'a>(all: impl Iterator<Item = (&'a Demodulation, &'a [IdentifiedPoint])>) -> Table {
    let mut table = Table::new("Closed loop of Eq. 3.44 and the identified plants", &[]).note(
        "Largest magnitude of the poles of (z − 1)² (z − p₁)(z − p₂) + k_s k_φ (z − z_s); above 1 the loop \
         is unstable. Design: the fastest with its zero at a quarter of the crossover and a sensitivity peak of 2 at \
         most, on the plant at 1.5 A, as in the source; the printed k_s is in rad/A and says nothing for the synchronous signal.",
    );
    let printed: Vec<Model> = (0..TABLE_6.len()).map(Model::printed).collect();
    let mut rows = |name: &str, plants: &[Model], in_amperes: bool| {
        let design = plants[DESIGN_ROW].design();
        for ((iq, ..), plant) in TABLE_6.iter().zip(plants) {
            let with = |pii: Pii| largest_pole(&plant.closed_loop(pii));
            let as_printed = |pii| Cell::fixed_or_dash(in_amperes.then(|| with(pii)), 5);
            let here = design.filter(|_| *iq == TABLE_6[DESIGN_ROW].0);
            let poles = here.map(|(pii, _)| roots(&plant.closed_loop(pii))).map(|poles| {
                let upper = poles.iter().filter(|p| p.im >= 0.0).map(|&p| complex(p));
                upper.collect::<Vec<_>>().join(", ")
            });
            table.record([
                ("plant", Cell::from(name)),
                ("iq (A)", Cell::fixed(*iq, 1)),
                ("largest pole, printed k_s, z_s = 0.90", as_printed(PRINTED_PII)),
                ("printed k_s, z_s = 0.99", as_printed(LIKELY_PII)),
                ("designed for 1.5 A", Cell::fixed_or_dash(design.map(|(pii, _)| with(pii)), 5)),
                (
                    "k_s (rad per signal)",
                    Cell::or_dash(here.map(|(pii, _)| Cell::significant(pii.k_s, 3))),
                ),
                ("z_s", Cell::fixed_or_dash(here.map(|(pii, _)| pii.z_s), 4)),
                ("crossover (Hz)", Cell::fixed_or_dash(here.map(|(_, w)| w * RATE_HZ / TAU), 1)),
                ("poles of the design", Cell::or_dash(poles.map(Cell::from))),
            ]);
        }
    };
    rows("Table 6", &printed, true);
    for (demodulation, points) in all {
        let plants: Vec<Model> = points.iter().map(|p| p.models[1]).collect();
        rows(demodulation.name, &plants, demodulation.demodulator != DemodulatorKind::Synchronous);
    }
    table
}

fn fit_figure(demodulation: &Demodulation, p: &IdentifiedPoint) -> Figure {
    let shown = (0.5 * RATE_HZ) as usize;
    let line = |y: &[f64]| {
        y.iter().take(shown).enumerate().map(|(k, y)| (k as f64 / RATE_HZ, y * 1e3)).collect()
    };
    let (model, fit) = p.models[1].fit(&p.record);
    let title =
        format!("{}: measured and by Eq. 3.43, iq = 1.5 A, fit {fit:.0} %", demodulation.name);
    let turn = p.record.u.iter().map(|u| u.to_degrees() / 1e3).collect::<Vec<_>>();
    Figure::new(format!("fit_{}", demodulation.name), title, "Figure 34")
        .panel(
            Panel::new("time (s)", format!("signal ({})", demodulation.unit()))
                .with(Series::line("measured, mean of 6 periods", line(&p.record.y)))
                .with(Series::reference("Eq. 3.43", line(&model))),
        )
        .panel(Panel::new("time (s)", "turn of the axis (°)").with(Series::line("u", line(&turn))))
}

fn bode_figure(demodulation: &Demodulation, points: &[IdentifiedPoint]) -> Figure {
    let hz = frequencies(1.0, 600.0, 120);
    let bode = Bode { hz: &hz, label: "frequency (Hz)", shown: |hz| hz };
    // In thousandths, as the signals are printed.
    let scaled = |m: Model| Model { k: m.k * 1e3, ..m };
    let models: Vec<(String, Model)> = TABLE_6
        .iter()
        .zip(points)
        .map(|((iq, ..), p)| (format!("{iq} A"), scaled(p.models[1])))
        .chain(
            (demodulation.demodulator != DemodulatorKind::Synchronous)
                .then(|| ("Table 6, 1.5 A".into(), scaled(Model::printed(DESIGN_ROW)))),
        )
        .collect();
    let (gain, phase) =
        bode.panels(models.iter().map(|(name, model)| (name, |w: f64| model.response(w))));
    let title =
        format!("{}: identified, gain in {} per rad", demodulation.name, demodulation.unit());
    Figure::new(format!("bode_{}", demodulation.name), title, "Figure 35").panel(gain).panel(phase)
}

fn step_figure(demodulation: &Demodulation, points: &[IdentifiedPoint]) -> Figure {
    let panel = |of: &str, pick: fn(&IdentifiedPoint) -> &Vec<f64>| {
        let y = format!("{of} ({} / rad)", demodulation.unit());
        TABLE_6.iter().zip(points).fold(Panel::new("time (ms)", y), |panel, ((iq, ..), p)| {
            // Over a carrier period: the rest is ripple.
            let mean = |c: &[f64]| c.iter().sum::<f64>() / c.len() as f64 * 1e3;
            let line = pick(p)
                .chunks(5)
                .enumerate()
                .map(|(n, c)| ((n as f64 * 5.0 + 2.0) / RATE_HZ * 1e3, mean(c)))
                .collect();
            panel.with(Series::line(format!("iq = {iq} A"), line))
        })
    };
    let title = format!("{}: answer to a step of the axis", demodulation.name);
    Figure::new(format!("step_{}", demodulation.name), title, "")
        .panel(panel("axis alone", |p| &p.steps.alone))
        .panel(panel("with the current", |p| &p.steps.with_current))
}

fn poles_figure(points: &[IdentifiedPoint]) -> Figure {
    let turns = (0..=60).map(|n| 0.004 * f64::from(n - 30));
    let arc = turns.map(|x| (x.cos(), x.sin())).collect();
    let mut panel = Panel::new("real part", "imaginary part").equal_axes();
    let mut add = |name: &str, plant: Model, pii: Option<Pii>| {
        let poles = pii.map(|pii| roots(&plant.closed_loop(pii)));
        let points = poles.iter().flatten().map(|p| (p.re, p.im)).collect();
        panel.series.push(Series::points(name, points));
    };
    add("Table 6, printed controller", Model::printed(DESIGN_ROW), Some(PRINTED_PII));
    for (demodulation, points) in DEMODULATIONS.iter().zip(points.chunks(TABLE_6.len())) {
        let plant = points[DESIGN_ROW].models[1];
        add(&format!("{}, designed", demodulation.name), plant, plant.design().map(|d| d.0));
    }
    panel.series.push(Series::limit("unit circle", arc));
    Figure::new("poles", "Poles of the closed loop at iq = 1.5 A", "Eq. 3.44").panel(panel)
}

/// Smallest and largest fit of Eq. 3.43, %.
fn fits(points: &[IdentifiedPoint]) -> (f64, f64) {
    let fits = points.iter().map(|p| p.models[1].fit(&p.record).1);
    fits.fold((f64::MAX, f64::MIN), |(least, most), fit| (least.min(fit), most.max(fit)))
}

/// Largest distance of the poles from those of Table 6, in either part.
fn distance(points: &[IdentifiedPoint]) -> f64 {
    let of = |(row, p): (usize, &IdentifiedPoint)| {
        let [ours, printed] = [&p.models[1], &Model::printed(row)].map(Model::poles);
        let apart = ours[0] - printed[0];
        apart.re.abs().max(apart.im.abs())
    };
    points.iter().enumerate().map(of).fold(0.0, f64::max)
}

fn remarks(points: &[IdentifiedPoint]) -> Vec<String> {
    let mut all = points.chunks(TABLE_6.len());
    let literal = all.next().unwrap_or_default();
    let [first, second] = [literal, all.next().unwrap_or_default()].map(fits);
    vec![
        "Two plants. With the encoder the current stays where it is when the injection axis is turned, so \
         the part of the saliency that belongs to the current is seen to turn, together with that of \
         the flux: slope 2(|a| + b |i| |cos 2γ|), growing with iq. This is what section 3.11 \
         identifies (Table 6). Without the encoder the current is put on the estimated angle: it turns \
         with the axis, its part of the saliency stands still in the estimated frame, and slow errors \
         meet 2|a| alone, whatever iq. Errors faster than the current loop meet the first. A controller \
         made from Table 6 is made for a plant the loop is not closed around."
            .into(),
        "As printed (literal), the identified plant is real, but all of it is the fundamental current \
         leaking through the band-pass: with the current turning, its gain is zero. That is why an \
         identification that looks sound made a loop that cannot track."
            .into(),
        format!(
            "Eq. 3.43 fits no chain well: the literal one by {:.0} to {:.0} %, whose step response is that of the \
             post-processing filter and whose poles come out within {:.3} of those of Table 6 in either part; the \
             rectified one by {:.0} to {:.0} %. Where the carrier is \
             seen, a step of the axis shows at once, before the carrier current has turned: for 2 samples, \
             and in the rectified chain for the 8.8 samples of the band-pass as well, which it rotates \
             afterwards. The signal answers to how fast the axis turns, not only to where it is. Eq. 3.43 has \
             no zero for that: its gain comes out too high (compare with the steps). In the \
             loop it is a damping, without which the printed z_s = 0.90 loses the angle (see demodulators).",
            first.0,
            first.1,
            distance(literal),
            second.0,
            second.1,
        ),
    ]
}
