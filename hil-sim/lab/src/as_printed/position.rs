//! Figure 37: the printed position controller on the plant of Eq. 4.1, and the cascade of the drive on the same shaft.

use crate::prelude::*;
use crate::recomputed::plant;

/// Duration of the runs, s.
const SECONDS: f64 = 3.0;
/// Limit of the q-axis current, A: the limit of the drive.
const LIMIT_A: f64 = 3.0;

/// Position, q-axis current and speed over time.
#[derive(Default)]
struct Trace {
    degrees: Vec<(f64, f64)>,
    current: Vec<(f64, f64)>,
}

/// Adds the figure and the comparisons.
pub fn add(context: &Context<'_>, outcome: &mut Outcome) -> Result<(), Error> {
    let (literal, ours) = (literal(), ours(context)?);
    let zero_from = |trace: &Trace| {
        let last = trace.current.iter().rfind(|(_, i)| i.abs() > 0.15);
        1e3 * last.map_or(f64::NAN, |(t, _)| *t)
    };
    // Peak to peak over the last second.
    let swing = |trace: &Trace| {
        let late = trace.degrees.iter().filter(|(t, _)| *t > SECONDS - 1.0);
        let late = sorted(late.map(|(_, degrees)| *degrees));
        late[late.len() - 1] - late[0]
    };
    let target = 360.0 * printed("Figure 37", "reference of position in turns");
    let rests = |trace: &Trace| {
        let mut late = trace.degrees.iter().filter(|(t, _)| *t > SECONDS - 1.0);
        late.all(|(_, degrees)| (degrees - target).abs() < 5.0)
    };
    outcome.metrics.set("figure_37_printed_swing_deg", swing(&literal));
    outcome.metrics.set("figure_37_ours_swing_deg", swing(&ours));
    outcome.metrics.set("figure_37_ours_current_zero_from_ms", zero_from(&ours));
    let unknown = "the limit of the current, and a controller that comes to rest on its plant";
    let at_start = literal.current.first().is_some_and(|(_, i)| *i >= LIMIT_A - 1e-9);
    outcome.compared.extend([
        named("current_zero_at").unknown(unknown).simulated(zero_from(&ours)),
        named("current_saturates").of_print(at_start),
        named("works_as_servo").of_print(rests(&literal)).simulated(rests(&ours)),
    ]);
    let target = vec![(0.0, target), (SECONDS, target)];
    let stop = printed("Figure 37", "time at which the quadrature current is zero") / 1e3;
    let figure = texts::figure("as-printed", "position");
    let panel = Panel::new("time (s)", "position (°)")
        .with(Series::line("printed controller", literal.degrees))
        .with(Series::line("cascade of the drive", ours.degrees))
        .with(Series::reference("reference", target));
    let current = Panel::new("time (s)", "iq (A)")
        .with(Series::line("printed controller", literal.current))
        .with(Series::line("cascade of the drive", ours.current))
        .with(Series::limit("printed: zero from 900 ms", vec![(stop, -LIMIT_A), (stop, LIMIT_A)]));
    outcome.figures.push(figure.panel(panel).panel(current));
    Ok(())
}

/// Simulates Eq. 4.1 to 4.3 at 100 Hz: position in radians, PI with the anti-windup of appendix B, and no torque beyond 1440 rpm.
fn literal() -> Trace {
    let plant = plant("Eq. 4.1");
    let (gain, zero) = (printed("Eq. 4.2", "gain"), printed("Eq. 4.2", "zero"));
    let (pole, rate) = (printed("Eq. 4.3", "pole"), printed("Eq. 4.1", "f_s"));
    let fastest = printed("section 4.1", "limit of the speed") * TAU / 60.0;
    let target = printed("Figure 37", "reference of position in turns") * TAU;
    let mut trace = Trace::default();
    let (mut y, mut moved, mut reference, mut u, mut before) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for n in 0..(SECONDS * rate) as u32 {
        let t = f64::from(n) / rate;
        reference = pole * reference + (1.0 - pole) * target;
        let error = reference - y;
        u = (u + gain * (error - zero * before)).clamp(-LIMIT_A, LIMIT_A);
        before = error;
        let allowed = if moved * rate > fastest { u.min(0.0) } else { u };
        trace.degrees.push((t, y * 360.0 / TAU));
        trace.current.push((t, allowed));
        // k / ((z - 1)(z - p)): the change of the position is a first-order lag of the current.
        y += moved;
        moved = plant.p * moved + plant.k * allowed;
    }
    trace
}

/// Simulates the drive on a shaft with the time constant and the gain of Eq. 4.1.
fn ours(context: &Context<'_>) -> Result<Trace, Error> {
    let mut config = context.config.clone();
    let (plant, rate) = (plant("Eq. 4.1"), printed("Eq. 4.1", "f_s"));
    let time_constant = -1.0 / (rate * plant.p.ln());
    // rad/s per ampere in steady state, and newton metres per ampere.
    let per_ampere = plant.k * rate / (1.0 - plant.p);
    // Eq. 2.7 with L_m²/L_r, with 0.7 A of magnetising current, Nm/A.
    let torque = source::value_of("S1", "torque_per_ampere").unwrap_or(f64::NAN);
    config.motor.friction = torque / per_ampere;
    config.motor.inertia = time_constant * config.motor.friction;
    config.drive.inertia = Some(config.motor.inertia as f32);
    config.drive.angle_source = AngleSource::Encoder;
    config.drive.speed.limit_rpm = Some(printed("section 4.1", "limit of the speed") as f32);
    // 70 % of the acceleration at the largest q-axis current.
    let fastest = 0.7 * LIMIT_A * torque / config.motor.inertia * 60.0 / TAU;
    config.drive.speed.ramp_rpm_per_s = Some(fastest as f32);
    config.load.mode = LoadMode::Free;
    let mut rig = Rig::started(&config, context.seed, Mode::Position)?;
    rig.command(&Command::Position(printed("Figure 37", "reference of position in turns") as f32))?;
    let (start, mut trace, mut n) = (rig.time(), Trace::default(), 0);
    let from = rig.plant.mechanical_angle() / TAU;
    rig.run(SECONDS, |p| {
        if n % 60 == 0 {
            trace.degrees.push((p.t - start, 360.0 * (p.turns - from)));
            trace.current.push((p.t - start, p.iq));
        }
        n += 1;
    });
    Ok(trace)
}
