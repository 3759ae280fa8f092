//! The position step of section 4.1, with the encoder.

use std::f64::consts::TAU;

use drive_core::{Command, Mode};

use super::{BENCH, Context, DRIVE, Experiment, TRACKING};
use crate::config::{Config, LoadMode};
use crate::error::Error;
use crate::outcome::{Figure, Outcome, Panel, Series};
use crate::rig::{Point, Rig};
use crate::stats::Stats;
use drive_core::AngleSource;

/// Figure 37.
pub const EXPERIMENT: Experiment = Experiment {
    name: "position-step",
    stands_for: "Figure 37, Eq. 4.1 to 4.3",
    about: "A position step of five turns with the encoder and a free shaft.",
    uses: &[BENCH, DRIVE, &["load.", "seconds"]],
    not: &[TRACKING, &["angle_source"]],
    run,
};

/// The step.
pub const TURNS: f64 = 5.0;
/// Tolerance of the arrival: one mechanical degree, in turns.
pub const ARRIVED: f64 = 1.0 / 360.0;
/// With the encoder: the largest speed of section 4.1, and the acceleration by 2.7 A. Without it the
/// drive's own, lower ones hold.
const ENCODER_LIMIT_RPM: f32 = 1440.0;
const ENCODER_RAMP_RPM_PER_S: f32 = 700.0;

/// A position step of five turns with this source of the angle. Times and positions count from the
/// step; with them comes the fault with which the drive has stopped itself.
///
/// # Errors
/// When the configuration is refused or the drive does not start.
pub fn step(
    config: &Config,
    source: AngleSource,
    seed: u64,
    seconds: f64,
) -> Result<(Vec<Point>, Option<String>), Error> {
    let mut config = config.clone();
    config.drive.angle_source = source;
    if source == AngleSource::Encoder {
        config.drive.speed.limit_rpm.get_or_insert(ENCODER_LIMIT_RPM);
        config.drive.speed.ramp_rpm_per_s.get_or_insert(ENCODER_RAMP_RPM_PER_S);
    }
    if config.load.mode == LoadMode::Locked {
        config.load.mode = LoadMode::Free;
    }
    let mut rig = Rig::from_config(&config, seed)?;
    rig.start(Mode::Position)?;
    let (start, origin) = (rig.time(), rig.plant.mechanical_angle() / TAU);
    rig.command(&Command::Position(TURNS as f32))?;
    let mut points = Vec::new();
    rig.run(seconds, |p| {
        points.push(Point { t: p.t - start, turns: p.turns - origin, ..*p });
    });
    Ok((points, rig.fault()))
}

/// Overshoot in percent, and when the rotor was more than a degree from the reference for the last
/// time, s.
pub fn overshoot_and_settling(points: &[Point]) -> (f64, f64) {
    let furthest = points.iter().map(|p| p.turns).fold(f64::MIN, f64::max);
    let late = |p: &&Point| (p.turns - TURNS).abs() > ARRIVED;
    let settling = points.iter().rev().find(late).map_or(0.0, |p| p.t);
    ((furthest / TURNS - 1.0).max(0.0) * 100.0, settling)
}

/// How far the rotor is from the reference at the end, mechanical degrees.
pub fn final_error_deg(points: &[Point]) -> f64 {
    points.last().map_or(f64::NAN, |p| (p.turns - TURNS) * 360.0)
}

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let seconds = context.seconds.unwrap_or(5.0);
    let (points, fault) = step(context.config, AngleSource::Encoder, context.seed, seconds)?;

    let mut outcome = Outcome::default();
    outcome.faults.extend(fault);
    let largest = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::MIN, f64::max);
    let (overshoot, settling) = overshoot_and_settling(&points);
    let m = &mut outcome.metrics;
    m.set("overshoot_pct", overshoot);
    m.set("settling_s", settling);
    m.set("final_error_deg", final_error_deg(&points));
    m.set("iq_max_a", largest(|p| p.iq.abs()));
    m.set("speed_max_rpm", largest(|p| p.speed_rpm));
    let error = Stats::of(points.iter().map(|p| p.angle_error_deg));
    m.set("angle_error_rms_deg", error.rms());
    m.set("angle_error_max_deg", error.largest());

    let line = |of: fn(&Point) -> f64| points.iter().map(|p| (p.t, of(p))).collect::<Vec<_>>();
    let end = points.last().map_or(0.0, |p| p.t);
    let x = "time (s)";
    outcome.figures.push(
        Figure::new("position", "Position step with the encoder", "Figure 37")
            .panel(
                Panel::new(x, "position (° mechanical)")
                    .with(Series::line("rotor", line(|p| p.turns * 360.0)))
                    .with(Series::reference(
                        "reference",
                        vec![(0.0, TURNS * 360.0), (end, TURNS * 360.0)],
                    )),
            )
            .panel(
                Panel::new(x, "quadrature current (A)")
                    .with(Series::line("measured", line(|p| p.iq)))
                    .with(Series::reference("reference", line(|p| p.iq_ref))),
            )
            .panel(Panel::new(x, "speed (rpm)").with(Series::line("rotor", line(|p| p.speed_rpm))))
            .panel(
                Panel::new(x, "flux angle error (°)")
                    .with(Series::line("true minus computed", line(|p| p.angle_error_deg))),
            ),
    );
    outcome.remarks.push(format!(
        "The printed gains of Eq. 4.2 are unstable with the plant of Eq. 4.1 (|z| = 1.046): they were \
         designed as if one of its integrators were not there. Here a PI controller of the speed, \
         designed for 60° of phase margin, stands inside a P controller of the position; the speed \
         it may ask for follows a braking curve and a ramp instead of the filter of Eq. 4.3. Inertia \
         ({} kg m²) and friction are assumed. Eq. 4.1, the identified plant, has a mechanical time constant of \
         10 ms / −ln 0.95782 = 0.232 s; with 0.322 Nm/A and its gain read in rad/s that is 0.0018 kg m² and 0.0079 Nm s. The \
         shaft simulated here coasts far longer.",
        context.config.motor.inertia
    ));
    Ok(outcome)
}
