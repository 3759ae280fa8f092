//! The drive of Barroso 2017 as printed: without a sensor (Figures 38 and 39), its angle reference (Eq. 2.10), the position controller on the plant for
//! which it was designed (Figure 37), filter and rotation in either order (section 3.4), and Table 1 as runs.

mod beside;
mod order;
mod position;
mod sources;

use crate::prelude::*;

/// Flux-fixed saliencies of the simulated motors; the source measures none.
const SALIENCIES: [f64; 3] = [-0.002, -0.0035, -0.035];
/// Current levels of Figure 38, A.
pub(crate) const LEVELS_A: [f64; 5] = [1.0, 1.25, 1.5, 1.75, 2.0];

/// Means over the second half of each current level; the run ends if the drive stops itself.
#[derive(Default)]
struct Levels {
    error: Vec<f64>,
    torque: Vec<f64>,
    /// Overshoot of the q-axis current at the last level, A.
    overshoot: f64,
    trace: Vec<(f64, f64)>,
}

/// Runs the experiment: Figures 37 to 39, Table 1, section 3.4.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let mut outcome = Outcome::default();
    let found =
        context.in_parallel("as-printed", &SALIENCIES, |_, &a_psi| levels(context, a_psi))?;
    let mut table = texts::table("as-printed", "levels");
    let mut panel = Panel::new("time (s)", "angle error (°)").y_range(-20.0, 90.0);
    for (a_psi, run) in SALIENCIES.iter().zip(&found) {
        let name = format!("saliency {:.2} %", 100.0 * a_psi);
        for (k, level) in LEVELS_A.iter().enumerate() {
            table.record([
                ("saliency", Cell::from(&*name)),
                ("iq (A)", Cell::fixed(*level, 2)),
                ("angle error (°)", Cell::fixed_or_dash(run.error.get(k).copied(), 1)),
                ("torque (Nm)", Cell::fixed_or_dash(run.torque.get(k).copied(), 3)),
            ]);
        }
        panel = panel.with(Series::line(name, run.trace.clone()));
    }
    let band = |figure: &str, which: &str| {
        let degrees = printed(figure, &format!("angle error, {which}"));
        vec![(0.0, degrees), (LEVELS_A.len() as f64, degrees)]
    };
    outcome.tables.push(table);
    panel = beside::add(context, &mut outcome, panel)?
        .with(Series::limit("printed, about 50°", band("Figure 38", "about")))
        .with(Series::reference("40° and 60° of Figure 39", band("Figure 39", "least")))
        .with(Series::reference("", band("Figure 39", "largest")));
    outcome.figures.push(texts::figure("as-printed", "levels").panel(panel));
    // The motor whose errors are closest to the printed ones: a tenth of the assumed saliency.
    let weak = &found[1];
    let errors = Stats::of(weak.error.iter().copied());
    let unknown = "the saliency of its motor, and the q-axis current of each angle error";
    for (place, quantity, value) in [
        ("Figure 38", "angle error, about", errors.mean()),
        ("Figure 39", "angle error, least", weak.error.iter().copied().fold(f64::MAX, f64::min)),
        ("Figure 39", "angle error, largest", errors.largest()),
        ("Figure 38", "overshoot of the current in the last step", 1e3 * weak.overshoot),
    ] {
        outcome.compared.push(beside(place, quantity).unknown(unknown).simulated(value));
    }
    for (k, level) in LEVELS_A.iter().enumerate() {
        let value = weak.error.get(k).copied().unwrap_or(f64::NAN);
        outcome.metrics.set(format!("weak_saliency_error_at_{level}_a_deg"), value);
    }
    let ratio = weak.torque.last().zip(weak.torque.first()).map_or(f64::NAN, |(l, f)| l / f);
    outcome.metrics.set("weak_saliency_torque_ratio", ratio);
    texts::add_remarks(&mut outcome, "as-printed", &[]);
    let of = |quantity, used| beside("Figure 38", quantity).used(used);
    outcome.compared.extend([
        of("reference of current, first level", LEVELS_A[0]),
        of("step of the current from level to level", 1e3 * (LEVELS_A[1] - LEVELS_A[0])),
        of("reference of current, last level", LEVELS_A[4]),
    ]);
    position::add(context, &mut outcome)?;
    order::add(&mut outcome)?;
    sources::add(context, &mut outcome)?;
    Ok(outcome)
}

/// Runs the torque steps with the chain of the source and the added rectifier.
fn levels(context: &Context<'_>, a_psi: f64) -> Result<Levels, Error> {
    let mut config = context.config.clone();
    config.saliency.a_psi = a_psi;
    config.drive.injection.demodulator = DemodulatorKind::Rectified;
    config.drive.ignore_delays = true;
    config.drive.injection.synchronous.check = false;
    config.load.mode = LoadMode::Locked;
    let mut rig = Rig::started(&config, context.seed, Mode::Torque)?;
    let start = rig.time();
    let mut run = Levels::default();
    for level in LEVELS_A {
        if rig.drive.state().fault().is_some() {
            break;
        }
        rig.command(&Command::Torque(level as f32))?;
        let (mut error, mut torque, mut n) = (Stats::default(), Stats::default(), 0);
        let overshoot = &mut run.overshoot;
        *overshoot = 0.0;
        rig.run(1.0, |p| {
            n += 1;
            *overshoot = overshoot.max(p.iq - level);
            if n % 60 == 0 {
                run.trace.push((p.t - start, p.angle_error_deg));
            }
            if n > 3000 {
                error.push(p.angle_error_deg);
                torque.push(p.torque);
            }
        });
        run.error.push(error.mean());
        run.torque.push(torque.mean());
    }
    Ok(run)
}
