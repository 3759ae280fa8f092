//! The five demodulations on one motor.

pub(super) mod demodulation;
mod signal;
pub(super) mod tracked;

use sim_bench::learning;
use sim_bench::steady::{OperatingPoint, SteadyRun, steady_run};

use crate::injection_map::{self, Curve, Variant};
use crate::prelude::*;
use demodulation::{DEMODULATIONS, Demodulation, ReferenceKind};
use signal::{SETTLED_S, SignalQuality, signal_quality};
use tracked::StepsRun;

/// q-axis currents of the map and of the table, A.
const IQ_A: [f64; 4] = [0.5, 1.0, 2.0, 3.0];
/// q-axis current for the measurement of the delay and for the runs at constant speed, A.
const DELAY_IQ_A: f64 = 1.0;
const RUN_IQ_A: f64 = 1.5;
/// Speeds, rpm.
const SPEEDS_RPM: [f64; 2] = [0.0, 150.0];

/// Results of one demodulation.
struct DemodulationResults {
    /// Curves with saliency and without, by q-axis current.
    maps: [Vec<Curve>; 2],
    seen: Vec<SignalQuality>,
    isotropic: Vec<SignalQuality>,
    /// Delay, samples; none if the saliency makes no difference.
    delay: Option<f64>,
    /// Results by kind of reference and controller.
    tracked: Vec<Option<ClosedLoop>>,
}

impl DemodulationResults {
    fn of(demodulation: &Demodulation, context: &Context<'_>) -> Result<Self, Error> {
        let (config, seed) = (context.config, context.seed);
        let mut isotropic = config.clone();
        injection_map::take_saliency(&mut isotropic);
        let map = |saliency: bool| {
            let (demodulator, compensate) = (demodulation.0, !config.drive.ignore_delays);
            let variant = Variant { demodulator, saliency, compensate, ..injection_map::LITERAL };
            let curve = |&iq: &f64| injection_map::curve(config, seed, variant, iq);
            IQ_A.par_iter().map(curve).collect::<Result<Vec<_>, _>>()
        };
        let at_each = |config: &Config| {
            let config = demodulation.config(config);
            let quality = |&iq: &f64| signal_quality(Rig::oriented(&config, seed, iq, SETTLED_S)?);
            IQ_A.par_iter().map(quality).collect::<Result<Vec<_>, _>>()
        };
        let learned = learning::reference_of(demodulation.0, &demodulation.config(config), seed)?;
        let track = |kind: ReferenceKind| -> Result<Option<ClosedLoop>, Error> {
            let Some(config) = demodulation.drive(kind, config, learned) else { return Ok(None) };
            let case = |&rpm: &f64| OperatingPoint { rpm, iq: RUN_IQ_A, seed };
            let turning = SPEEDS_RPM.par_iter().map(|rpm| steady_run(&config, case(rpm), 1.0));
            let turning = turning.collect::<Result<_, _>>()?;
            Ok(Some(ClosedLoop { steps: tracked::steps(&config, seed)?, turning }))
        };
        let mut found = Self {
            maps: [map(true)?, map(false)?],
            seen: at_each(config)?,
            isotropic: at_each(&isotropic)?,
            delay: None,
            tracked: ReferenceKind::VALUES
                .iter()
                .map(|&kind| track(kind))
                .collect::<Result<_, _>>()?,
        };
        if found.isotropic_share() < 0.5 {
            found.delay = Some(signal::delay(demodulation.config(config), DELAY_IQ_A, seed)?);
        }
        Ok(found)
    }

    fn at_one_ampere(&self) -> (&SignalQuality, &SignalQuality) {
        let one = IQ_A.iter().position(|&iq| iq == DELAY_IQ_A).unwrap_or(0);
        (&self.seen[one], &self.isotropic[one])
    }

    /// Share of the signal that is also present without saliency.
    fn isotropic_share(&self) -> f64 {
        let (seen, isotropic) = self.at_one_ampere();
        (isotropic.signal / seen.signal).abs()
    }
}

struct ClosedLoop {
    steps: StepsRun,
    /// Runs of one second at constant speed and torque, by speed.
    turning: Vec<SteadyRun>,
}

/// Runs the experiment: Section 5.2 names two ways to extract the injection current better.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let found = context.in_parallel("demodulators", &DEMODULATIONS, |_, demodulation| {
        DemodulationResults::of(demodulation, context)
    })?;

    let mut outcome = Outcome::default();
    let all = || DEMODULATIONS.iter().zip(&found);
    outcome.tables.push(seen_table(all()));
    outcome.tables.push(tracked_table(&found));
    outcome.figures.extend(all().map(|(demodulation, f)| map_figure(demodulation, f)));
    outcome.figures.push(steps_figure(&found));
    for (demodulation, f) in all() {
        let m = &mut outcome.metrics;
        let (seen, _) = f.at_one_ampere();
        m.set(format!("{}_delay_samples", demodulation.key()), f.delay.unwrap_or(f64::NAN));
        m.set(format!("{}_noise_deg", demodulation.key()), degrees(seen.noise / seen.slope));
        m.set(format!("{}_isotropic_share", demodulation.key()), f.isotropic_share());
        for (kind, tracked) in ReferenceKind::VALUES.iter().zip(&f.tracked) {
            let (Some(t), kind) = (tracked, kind.word()) else { continue };
            let name = |what: &str| format!("{}_{kind}_{what}", demodulation.key());
            m.set(name("steps_lost"), f64::from(u8::from(t.steps.lost)));
            m.set(name("steps_rms_deg"), t.steps.stats.rms());
            m.set(name("steps_max_deg"), t.steps.stats.largest());
            for (rpm, run) in SPEEDS_RPM.iter().zip(&t.turning) {
                let rms = if run.lost { f64::NAN } else { run.error.rms() };
                m.set(name(&format!("{rpm}rpm_rms_deg")), rms);
            }
        }
    }
    let envelope = outcome.metrics.get("envelope_retuned_steps_lost") == Some(0.0);
    outcome.compared.push(named("envelope_promising").simulated(envelope));
    Ok(outcome)
}

fn degrees(radians: f64) -> f64 {
    radians.to_degrees().abs()
}

fn seen_table<'a>(all: impl Iterator<Item = (&'a Demodulation, &'a DemodulationResults)>) -> Table {
    let rows = all.flat_map(|(demodulation, f)| {
        IQ_A.iter().zip(&f.seen).zip(&f.isotropic).map(|((iq, s), i)| {
            [
                ("demodulation", Cell::from(demodulation.name())),
                ("iq (A)", Cell::fixed(*iq, 1)),
                ("unit", Cell::from(demodulation.unit())),
                ("signal", Cell::fixed(s.signal * 1e3, 2)),
                ("slope (per rad)", Cell::fixed(s.slope * 1e3, 1)),
                ("noise, rms", Cell::fixed(s.noise * 1e3, 3)),
                ("noise as angle (°)", Cell::fixed(degrees(s.noise / s.slope), 2)),
                ("signal without saliency", Cell::fixed(i.signal * 1e3, 2)),
                ("as angle (°)", Cell::fixed(degrees(i.signal / s.slope), 1)),
                ("slope without saliency", Cell::fixed(i.slope * 1e3, 1)),
            ]
        })
    });
    texts::table("demodulators", "seen").records(rows)
}

fn tracked_table(found: &[DemodulationResults]) -> Table {
    let fixed =
        ["demodulation", "reference", "delay (samples)", "torque steps, rms (°)", "largest (°)"];
    let by_speed = |rpm: f64| ["mean", "rms"].map(|of| format!("{rpm} rpm, {of} (°)"));
    let heads =
        fixed.map(String::from).into_iter().chain(SPEEDS_RPM.into_iter().flat_map(by_speed));
    let heads = heads.collect();
    let mut table = Table { columns: heads, ..texts::table("demodulators", "tracked") };
    table.note = table.note.replace("{iq_a}", &RUN_IQ_A.to_string());
    for (demodulation, f) in DEMODULATIONS.iter().zip(found) {
        for (kind, tracked) in ReferenceKind::VALUES.iter().zip(&f.tracked) {
            let (Some(t), kind) = (tracked, kind.word()) else { continue };
            let delay = Cell::fixed_or_dash(f.delay, 1);
            let mut row = vec![Cell::from(demodulation.name()), Cell::from(kind), delay];
            let mut add = |lost: bool, values: [f64; 2]| {
                row.extend(values.map(|x| if lost { "lost".into() } else { Cell::fixed(x, 2) }));
            };
            add(t.steps.lost, [t.steps.stats.rms(), t.steps.stats.largest()]);
            for run in &t.turning {
                add(run.lost, [run.error.mean(), run.error.rms()]);
            }
            table.row(row);
        }
    }
    table
}

fn map_figure(demodulation: &Demodulation, f: &DemodulationResults) -> Figure {
    let panel = |family: &[Curve], of: &str| {
        let y = format!("{of} ({})", demodulation.unit());
        injection_map::panel(y, &IQ_A, family)
    };
    let title = format!("{}: over the injection angle", demodulation.name());
    Figure::new(format!("map_{}", demodulation.key()), title, "Figure 19")
        .panel(panel(&f.maps[0], "with saliency"))
        .panel(panel(&f.maps[1], "without"))
}

fn steps_figure(found: &[DemodulationResults]) -> Figure {
    let x = "time (s)";
    let mut panels = [
        Panel::new(x, "error, constant reference (°)").y_range(-60.0, 60.0),
        Panel::new(x, "error, learned reference (°)").y_range(-60.0, 60.0),
        Panel::new(x, "error, learned, retuned (°)").y_range(-20.0, 20.0),
    ];
    for (demodulation, f) in DEMODULATIONS.iter().zip(found) {
        for (panel, tracked) in panels.iter_mut().zip(&f.tracked) {
            if let Some(t) = tracked {
                panel.series.push(Series::line(demodulation.name(), t.steps.error.clone()));
            }
        }
    }
    panels.into_iter().fold(texts::figure("demodulators", "steps"), Figure::panel)
}
