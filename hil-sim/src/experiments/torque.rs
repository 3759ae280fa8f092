//! The torque experiments of section 4.2: steps (Figure 38) and ramp (Figure 39) of the current on
//! the quadrature axis, shaft locked, without a position sensor.

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Accepted, Command, Mode};

use crate::error::Error;
use crate::experiments::{BENCH, Context, DRIVE, Experiment, SPEED_LOOP};
use crate::outcome::{Figure, Outcome, Panel, Series, Step};
use crate::rig::{Point, RATE_HZ, Rig, means_over};
use crate::stats::Stats;
use drive_core::carrier::DemodulatorKind;

pub use sim_bench::experiment::{LOST_DEG, assumptions};

/// Figure 38.
pub const STEPS: Experiment = Experiment {
    name: "torque-steps",
    stands_for: "Figure 38, Eq. 4.4",
    about: "Torque steps with a locked shaft and no position sensor: five levels, 1 to 2 times `reference.iq_a`.",
    uses: &[BENCH, DRIVE, &["load.", "reference.iq_a", "prepare.learn", "seconds"]],
    not: &[SPEED_LOOP],
    run: steps,
};

/// Figure 39.
pub const RAMP: Experiment = Experiment {
    name: "torque-ramp",
    stands_for: "Figure 39, Eq. 4.4",
    about: "Torque ramp with a locked shaft and no position sensor: `reference.iq_a` to twice that and back.",
    uses: &[BENCH, DRIVE, &["load.", "reference.iq_a", "prepare.learn", "seconds"]],
    not: &[SPEED_LOOP],
    run: ramp,
};

/// Section 5.2 asks for the response to disturbances.
pub const REVERSAL: Experiment = Experiment {
    name: "torque-reversal",
    stands_for: "section 5.2",
    about: "Sudden steps of the torque current up to full reversal, without a position sensor.",
    uses: &[BENCH, DRIVE, &["load.", "prepare.learn", "seconds"]],
    not: &[SPEED_LOOP],
    run: reversal,
};

/// Seconds after the first torque reference that are not judged: the angle settles from the
/// magnetising position.
const SETTLING_S: f64 = 0.5;
/// Levels of Figure 38, as multiples of `reference.iq_a`.
const LEVELS: [f64; 5] = [1.0, 1.25, 1.5, 1.75, 2.0];
/// Torque currents of the reversals one after another on the dissertation's motor, A.
const REVERSALS: [f64; 9] = [0.5, 1.0, 2.0, 3.0, 0.5, 2.0, -2.0, 3.0, -3.0];
/// Time at each level, s.
const LEVEL_S: f64 = 1.0;

/// Steps of the torque reference, Figure 38.
fn steps(context: &Context<'_>) -> Result<Outcome, Error> {
    let iq = context.config.iq_a();
    let what = ["steps", "Torque steps without a position sensor", "Figure 38"];
    levels(context, &LEVELS.map(|level| iq * level), what)
}

/// Steps up to full reversal.
fn reversal(context: &Context<'_>) -> Result<Outcome, Error> {
    let what = ["reversal", "Steps and reversals of the torque current", "section 5.2"];
    levels(context, &REVERSALS.map(|iq| context.config.amperes(iq)), what)
}

/// Steps to these levels, A.
fn levels(
    context: &Context<'_>,
    levels: &[f64],
    [name, title, source]: [&str; 3],
) -> Result<Outcome, Error> {
    let level_s = context.seconds.map_or(LEVEL_S, |s| s / levels.len() as f64);
    let profile = |t: f64| levels[((t / level_s) as usize).min(levels.len() - 1)];
    let run = Run::new(context, level_s * levels.len() as f64, profile)?;

    let mut outcome = run.outcome(name, title, source);
    let steps: Vec<Step> = (0..levels.len())
        .map(|n| run.level(levels[n], (n as f64 + 0.5) * level_s, (n + 1) as f64 * level_s))
        .collect();
    outcome.steps = Some(steps);
    let end = run.points.last().map_or(0.0, |p| p.t);
    let events = levels
        .iter()
        .enumerate()
        .skip(1)
        .map(|(n, level)| (n as f64 * level_s, format!("{level:.2} A")))
        .filter(|event| event.0 < end);
    if let Some(figure) = outcome.figures.first_mut() {
        // Before a fault, which ends the run.
        figure.events.splice(0..0, events);
    }
    Ok(outcome)
}

/// Ramp of the torque reference, Figure 39: `reference.iq_a`, up to twice that, hold, and back.
fn ramp(context: &Context<'_>) -> Result<Outcome, Error> {
    let scale = context.seconds.map_or(1.0, |s| s / 9.0);
    let iq = context.config.iq_a();
    let profile = |t: f64| {
        let t = t / scale;
        iq * (1.0 + ((t - 2.0) / 2.0).clamp(0.0, 1.0) - ((t - 6.0) / 2.0).clamp(0.0, 1.0))
    };
    let run = Run::new(context, 9.0 * scale, profile)?;
    let mut outcome = run.outcome("ramp", "Torque ramp without a position sensor", "Figure 39");
    let steps = [(1.0, 1.0, 2.0), (2.0, 5.0, 6.0), (1.0, 8.5, 9.0)]
        .map(|(times, from, to)| run.level(iq * times, from * scale, to * scale))
        .to_vec();
    outcome.steps = Some(steps);
    Ok(outcome)
}

/// Record of one run; times count from the first torque reference.
struct Run {
    points: Vec<Point>,
    demodulator: DemodulatorKind,
    fault: Option<String>,
    learned: bool,
    notes: Vec<String>,
}

impl Run {
    fn new(
        context: &Context<'_>,
        seconds: f64,
        profile: impl Fn(f64) -> f64,
    ) -> Result<Self, Error> {
        let mut rig = Rig::from_config(context.config, context.seed)?;
        rig.start(Mode::Torque)?;
        let start = rig.time();
        let periods = (seconds * RATE_HZ).round() as usize;
        let mut points = Vec::with_capacity(periods);
        let mut limited = None;
        let progress = context.progress.bar("simulating", periods as u64);
        // References change at the pace of a host, not of the control.
        for n in 0..periods.div_ceil(CARRIER_SAMPLES) {
            let reference = profile((n * CARRIER_SAMPLES) as f64 / RATE_HZ) as f32;
            if rig.fault().is_some() {
                break;
            }
            if let Accepted::Limited(a) = rig.command(&Command::Torque(reference))? {
                limited = Some(a);
            }
            rig.run(CARRIER_SAMPLES as f64 / RATE_HZ, |p| {
                points.push(Point { t: p.t - start, ..*p })
            });
            progress.advance(CARRIER_SAMPLES as u64);
        }
        let mut notes = assumptions(context.config);
        if let Some(a) = limited {
            notes.insert(0, format!("The drive limited the torque reference to {a:.3} A."));
        }
        let (demodulator, fault) = (context.config.drive.injection.demodulator, rig.fault());
        Ok(Self { points, demodulator, fault, learned: context.config.prepare.learn, notes })
    }

    fn after(&self, from: f64, to: f64) -> impl Iterator<Item = &Point> {
        self.points.iter().filter(move |p| p.t >= from && p.t < to)
    }

    fn level(&self, iq_ref_a: f64, from: f64, to: f64) -> Step {
        let mean = |of: fn(&Point) -> f64| Stats::of(self.after(from, to).map(of)).mean();
        Step {
            iq_ref_a,
            iq_a: mean(|p| p.iq),
            torque_nm: mean(|p| p.torque),
            angle_error_mean_deg: mean(|p| p.angle_error_deg),
        }
    }

    fn outcome(&self, name: &str, title: &str, source: &str) -> Outcome {
        let mut outcome = Outcome::default();
        let end = self.points.last().map_or(0.0, |p| p.t);
        let judged = || self.after(SETTLING_S.min(0.1 * end), f64::INFINITY);
        let error = Stats::of(judged().map(|p| p.angle_error_deg));
        let lost = self.fault.is_some() || error.largest() > LOST_DEG;
        let m = &mut outcome.metrics;
        m.set("angle_error_rms_deg", error.rms());
        m.set("angle_error_mean_deg", error.mean());
        m.set("angle_error_max_deg", error.largest());
        m.set("lost", f64::from(u8::from(lost)));
        m.set("iq_error_rms_a", Stats::of(judged().map(|p| p.iq - p.iq_ref)).rms());
        let difference = Stats::of(judged().map(|p| p.torque - eq_4_4(p)));
        m.set("torque_minus_eq_4_4_rms_nm", difference.rms());

        if let Some(fault) = &self.fault {
            let unlearned =
                if self.learned { "" } else { ", and had not learned (`prepare.learn`)" };
            outcome.remarks.push(format!("The drive stopped itself with {fault}{unlearned}."));
            outcome.faults.push(fault.clone());
        }
        outcome.remarks.extend(self.notes.iter().cloned());
        let mut figure = self.figure(name, title, source);
        figure.events.extend(self.fault.iter().map(|fault| (end, fault.clone())));
        outcome.figures.push(figure);
        outcome
    }

    fn figure(&self, name: &str, title: &str, source: &str) -> Figure {
        // Means over a carrier period: the injection's own ripple would hide everything else.
        let line = |of: fn(&Point) -> f64| means_over(CARRIER_SAMPLES, &self.points, of);
        let x = "time (s)";
        Figure::new(name, title, source)
            .panel(
                Panel::new(x, "quadrature current (A)")
                    .with(Series::line("measured", line(|p| p.iq)))
                    .with(Series::reference("reference", line(|p| p.iq_ref))),
            )
            .panel(
                Panel::new(x, "torque (Nm)").with(Series::line("motor", line(|p| p.torque))).with(
                    Series::reference(
                        "by Eq. 4.4 from flux, current and angle error",
                        line(eq_4_4),
                    ),
                ),
            )
            .panel(
                Panel::new(x, "angle error (° electrical)").with(Series::line(
                    "true minus estimated flux angle",
                    line(|p| p.angle_error_deg),
                )),
            )
            .panel(match self.demodulator {
                DemodulatorKind::Synchronous => Panel::new(x, "saliency (10⁻³)")
                    .with(Series::line("q, as demodulated", line(|p| p.saliency * 1e3))),
                _ => Panel::new(x, "current difference (mA)")
                    .with(Series::line("Δi", line(|p| p.delta_i * 1e3))),
            })
    }
}

/// Torque by Eq. 4.4 from the currents of the drive and the angle error: 3/2 P psi |i| sin(Delta
/// alpha), times L_m/L_r since psi is the rotor flux; Delta alpha = gamma - e, gamma from the
/// measured currents.
fn eq_4_4(p: &Point) -> f64 {
    let gamma = p.iq.atan2(p.id);
    let length = p.iq.hypot(p.id);
    p.torque_per_flux_ampere * p.flux * length * (gamma - p.angle_error_deg.to_radians()).sin()
}
