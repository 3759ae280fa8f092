//! The position step of section 4.1, with the encoder.

use drive_core::{Command, Mode};

use super::{Context, Experiment};
use crate::config::{AngleSource, LoadMode};
use crate::error::Error;
use crate::outcome::{Figure, Outcome, Panel, Series};
use crate::rig::{Point, Rig};
use crate::stats::Stats;

/// Figure 37.
pub const EXPERIMENT: Experiment = Experiment {
    name: "position-step",
    stands_for: "Figure 37, Eq. 4.1 to 4.3",
    about: "A position step of five turns with the encoder and a free shaft.",
    run,
};

const TURNS: f64 = 5.0;
/// One mechanical degree, in turns: what counts as arrived.
const ARRIVED: f64 = 1.0 / 360.0;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut config = context.config.clone();
    config.angle.source = AngleSource::Encoder;
    if config.load.mode == LoadMode::Locked {
        config.load.mode = LoadMode::Free;
    }
    let mut rig = Rig::from_config(&config, context.seed)?;
    rig.start(Mode::Position)?;
    let (start, origin) = (rig.time(), rig.plant.mechanical_angle() / std::f64::consts::TAU);
    rig.command(Command::Position(TURNS as f32))?;
    let mut points = Vec::new();
    rig.run(context.seconds.unwrap_or(5.0), |p| {
        points.push(Point { t: p.t - start, turns: p.turns - origin, ..*p });
    });

    let mut outcome = Outcome::default();
    let largest = |of: fn(&Point) -> f64| points.iter().map(of).fold(f64::MIN, f64::max);
    let late = |p: &&Point| (p.turns - TURNS).abs() > ARRIVED;
    let m = &mut outcome.metrics;
    m.set("overshoot_pct", (largest(|p| p.turns) / TURNS - 1.0).max(0.0) * 100.0);
    m.set("settling_s", points.iter().rev().find(late).map_or(0.0, |p| p.t));
    let end = points.last().map_or(f64::NAN, |p| p.turns - TURNS);
    m.set("final_error_deg", end * 360.0);
    m.set("iq_max_a", largest(|p| p.iq.abs()));
    m.set("speed_max_rpm", largest(|p| p.speed_rpm));
    let error = Stats::of(points.iter().map(|p| p.angle_error_deg));
    m.set("angle_error_rms_deg", error.rms());
    m.set("angle_error_max_deg", error.largest());

    let reference = |p: &Point| (p.t, TURNS * 360.0 * (1.0 - (-p.t / FILTER_S).exp()));
    let line = |of: fn(&Point) -> f64| points.iter().map(|p| (p.t, of(p))).collect::<Vec<_>>();
    let x = "time (s)";
    outcome.figures.push(
        Figure::new("position", "Position step with the encoder", "Figure 37")
            .panel(
                Panel::new(x, "position (° mechanical)")
                    .with(Series::line("rotor", line(|p| p.turns * 360.0)))
                    .with(Series::reference(
                        "filtered reference",
                        points.iter().step_by(60).map(reference).collect(),
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
    outcome.remarks.push(
        "The printed gains of Eq. 4.2 are unstable with the plant of Eq. 4.1 (|z| = 1.046). Here \
         the zero of 0.974 and the reference filter are as printed; the speed is fed back as well, \
         and the gain follows from the symmetric optimum. Inertia (0.012 kg m2) and friction are \
         assumed: the source gives none."
            .into(),
    );
    Ok(outcome)
}

/// Time constant of the reference filter, Eq. 4.3: pole 0.974 at 100 Hz.
const FILTER_S: f64 = 0.01 / 0.026_344;
