//! The speed loop without a position sensor: a profile with a reversal and a load step.

use drive_core::carrier::CARRIER_SAMPLES;
use drive_core::{Command, Mode};

use super::torque::{LOST_DEG, assumptions};
use super::{BENCH, Context, DRIVE, Experiment};
use crate::config::LoadMode;
use crate::error::Error;
use crate::outcome::{Figure, Outcome, Panel, Series};
use crate::plant::Load;
use crate::rig::{Point, Rig, means_over};
use crate::stats::Stats;

/// The aim of the source: motion without a sensor on the shaft.
pub const EXPERIMENT: Experiment = Experiment {
    name: "speed-profile",
    stands_for: "section 5.2",
    about: "Speed steps with a reversal through standstill and a load, with the angle source as set.",
    uses: &[BENCH, DRIVE, &["load.torque_nm", "prepare.learn", "seconds"]],
    not: &[],
    run,
};

/// Speed reference and load, as shares of the largest speed and of the load, each for so many seconds.
const PROFILE: [(f64, f64, f64); 7] = [
    (0.0, 0.0, 1.0),
    (0.5, 0.0, 2.0),
    (0.5, 1.0, 2.0),
    (-0.5, 1.0, 3.0),
    (0.0, 1.0, 2.0),
    (0.0, 0.0, 2.0),
    (1.0, 0.0, 2.5),
];
/// Largest speed reference on four poles, rpm, and load of the dissertation's motor, Nm.
const REFERENCE: (f64, f64) = (300.0, 0.6);
/// The end of each part that is judged as settled, s.
const SETTLED_S: f64 = 0.5;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let whole: f64 = PROFILE.iter().map(|p| p.2).sum();
    let scale = context.seconds.map_or(1.0, |s| s / whole);
    let mut config = context.config.clone();
    let load_nm = config.load.torque_nm.unwrap_or_else(|| config.newton_metres(REFERENCE.1));
    let largest_rpm = config.rpm(REFERENCE.0);
    config.load.mode = LoadMode::Free;
    config.load.torque_nm = None;
    let mut rig = Rig::from_config(&config, context.seed)?;
    rig.start(Mode::Speed)?;
    let start = rig.time();
    let mut points: Vec<Point> = Vec::new();
    let (mut wanted, mut events) = (Vec::new(), Vec::new());
    let mut acting = 0.0;
    let (mut steady, mut seen) = (Stats::default(), Stats::default());
    for (speed, load, seconds) in PROFILE {
        let (rpm, torque) = (speed * largest_rpm, load * load_nm);
        if rig.fault().is_some() {
            break;
        }
        rig.command(&Command::Speed(rpm as f32))?;
        rig.set_load(Load::Free { torque })?;
        let (begin, seconds) = (rig.time() - start, seconds * scale);
        wanted.extend([(begin, rpm), (begin + seconds, rpm)]);
        if torque != acting {
            acting = torque;
            let text =
                if torque == 0.0 { "load off".into() } else { format!("load {torque:.2} Nm") };
            events.push((begin, text));
        }
        let from = begin + seconds - SETTLED_S * scale;
        rig.run(seconds, |p| {
            let p = Point { t: p.t - start, ..*p };
            if p.t >= from {
                steady.push(p.speed_rpm - rpm);
                seen.push(p.speed_estimate_rpm - p.speed_rpm);
            }
            points.push(p);
        });
    }

    let mut outcome = Outcome::default();
    let error = Stats::of(points.iter().map(|p| p.angle_error_deg));
    let stopped = rig.fault();
    let m = &mut outcome.metrics;
    m.set("angle_error_rms_deg", error.rms());
    m.set("angle_error_max_deg", error.largest());
    m.set("speed_error_rms_rpm", steady.rms());
    m.set("speed_error_mean_rpm", steady.mean());
    m.set("speed_estimate_error_rms_rpm", seen.rms());
    m.set("speed_max_rpm", points.iter().map(|p| p.speed_rpm).fold(0.0, f64::max));
    m.set("lost", f64::from(u8::from(stopped.is_some() || error.largest() > LOST_DEG)));

    let line = |of: fn(&Point) -> f64| means_over(CARRIER_SAMPLES, &points, of);
    let x = "time (s)";
    // From the stop on the drive's telemetry stands still.
    let standing = |p: &&Point| points.last().is_some_and(|last| last.iq == p.iq);
    let stop = points.iter().rev().take_while(standing).last().map_or(0.0, |p| p.t);
    events.extend(stopped.iter().map(|fault| (stop, fault.clone())));
    outcome.faults.extend(stopped);
    outcome.figures.push(
        Figure::new(
            "profile",
            format!("Speed profile with a reversal and a load of {load_nm:.2} Nm"),
            "section 5.2",
        )
        .events(events)
        .panel(
            Panel::new(x, "speed (rpm)")
                .with(Series::line("rotor", line(|p| p.speed_rpm)))
                .with(Series::line("estimated", line(|p| p.speed_estimate_rpm)))
                .with(Series::reference("asked for", wanted)),
        )
        .panel(
            Panel::new(x, "quadrature current (A)").with(Series::line("measured", line(|p| p.iq))),
        )
        .panel(
            Panel::new(x, "angle error (° electrical)")
                .with(Series::line("true minus estimated", line(|p| p.angle_error_deg))),
        ),
    );
    outcome.remarks = assumptions(&config);
    outcome.remarks.push(format!("The load of {load_nm:.2} Nm acts from 3 s to 10 s."));
    Ok(outcome)
}
