//! Perturbation analysis: the angle error after steps of the load and of the q-axis current.

use crate::prelude::*;

/// Number of seeds over which the measured response is averaged; a fifth of the noise remains.
const SEEDS: u64 = 24;
/// Time before the step over which the mean is taken, and time after it that is measured, s.
const BEFORE_S: f64 = 0.5;
const AFTER_S: f64 = 1.5;

/// A disturbance.
#[derive(Clone, Copy)]
enum Disturbance {
    /// Step of the q-axis current reference, A; the shaft is locked.
    TorqueCurrent(f64),
    /// Step of the load torque, Nm; the shaft is free.
    Load(f64),
}

/// A step and the state before it.
#[derive(Clone, Copy)]
struct StepCase {
    name: &'static str,
    disturbance: Disturbance,
    /// Speed reference, rpm, or q-axis current before the step, A.
    from: f64,
    /// True rotor resistance divided by the one the drive assumes.
    warmer: f64,
}

impl StepCase {
    fn is_load(&self) -> bool {
        matches!(self.disturbance, Disturbance::Load(_))
    }

    /// Scales the case to the motor and the pole pairs of a configuration.
    fn scaled(self, config: &Config) -> Self {
        let (disturbance, from) = match self.disturbance {
            Disturbance::Load(nm) => {
                (Disturbance::Load(config.newton_metres(nm)), config.rpm(self.from))
            }
            Disturbance::TorqueCurrent(by) => {
                (Disturbance::TorqueCurrent(config.amperes(by)), config.amperes(self.from))
            }
        };
        Self { disturbance, from, ..self }
    }
}

const fn load(name: &'static str, rpm: f64, nm: f64) -> StepCase {
    StepCase { name, disturbance: Disturbance::Load(nm), from: rpm, warmer: 1.0 }
}

const fn current(name: &'static str, from: f64, to: f64, warmer: f64) -> StepCase {
    StepCase { name, disturbance: Disturbance::TorqueCurrent(to - from), from, warmer }
}

const CASES: [StepCase; 8] = [
    load("0.6 Nm at 0 rpm", 0.0, 0.6),
    load("0.6 Nm at 30 rpm", 30.0, 0.6),
    load("0.6 Nm at -150 rpm", -150.0, 0.6),
    current("1 A to 2 A", 1.0, 2.0, 1.0),
    current("2 A to -2 A", 2.0, -2.0, 1.0),
    current("3 A to -3 A", 3.0, -3.0, 1.0),
    current("1 A to 2 A, rotor 30 % warmer", 1.0, 2.0, 1.3),
    current("3 A to -3 A, rotor 30 % warmer", 3.0, -3.0, 1.3),
];

/// Response of a case.
struct StepResponse {
    case: StepCase,
    /// Mean over the seeds, minus the mean before the step.
    angle: Vec<f64>,
    speed: Vec<f64>,
    /// Largest single error, including noise.
    largest: f64,
    lost: usize,
}

fn peak(of: &[f64]) -> f64 {
    of.iter().copied().fold(0.0, |most, x| if x.abs() > f64::abs(most) { x } else { most })
}

/// Makes the configuration of a case: the drive assumes the resistance of the experiment's own configuration.
fn configured(config: &Config, case: &StepCase) -> Config {
    let mut config = config.clone();
    config.motor.r_r *= case.warmer;
    config.drive.angle_source = AngleSource::Injection;
    config.load.torque_nm = None;
    config.load.mode = if case.is_load() { LoadMode::Free } else { LoadMode::Locked };
    config
}

/// Returns angle error and speed from the step on; the first value is the mean before the step.
fn one(config: &Config, case: &StepCase, seed: u64) -> Result<(Vec<[f64; 2]>, f64, bool), Error> {
    let reference = |value: f64| match case.disturbance {
        Disturbance::Load(_) => Command::Speed(value as f32),
        Disturbance::TorqueCurrent(_) => Command::Torque(value as f32),
    };
    let mode = if case.is_load() { Mode::Speed } else { Mode::Torque };
    let mut rig = Rig::started(config, seed, mode)?;
    rig.settle(&reference(case.from), 2.0)?;
    let [angle, speed] = rig.stats(BEFORE_S, |p| [p.angle_error_deg, p.speed_rpm]);
    match case.disturbance {
        Disturbance::Load(nm) => rig.set_load(Load::Free { torque: nm })?,
        Disturbance::TorqueCurrent(by) => rig.command(&reference(case.from + by)).map(|_| ())?,
    }
    let (mut points, mut largest) = (Vec::new(), 0.0_f64);
    rig.run(AFTER_S, |p| {
        largest = largest.max(p.angle_error_deg.abs());
        points.push([p.angle_error_deg - angle.mean(), p.speed_rpm - speed.mean()]);
    });
    let lost = largest > LOST_DEG || rig.drive.state().fault().is_some();
    Ok((points, largest, lost))
}

fn measure(config: &Config, case: StepCase, seed: u64) -> Result<StepResponse, Error> {
    let config = configured(config, &case);
    let run = |n| one(&config, &case, seed.wrapping_add(n));
    let runs: Vec<_> = (0..SEEDS).into_par_iter().map(run).collect::<Result<_, _>>()?;
    let mean = |of: usize| -> Vec<f64> {
        let at = |k: usize| runs.iter().map(|(points, ..)| points[k][of] / SEEDS as f64).sum();
        (0..runs[0].0.len()).map(at).collect()
    };
    Ok(StepResponse {
        case,
        angle: mean(0),
        speed: mean(1),
        largest: runs.iter().map(|(_, largest, _)| *largest).fold(0.0, f64::max),
        lost: runs.iter().filter(|(.., lost)| *lost).count(),
    })
}

/// Runs the experiment: Section 5.2 lists it as future work.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let results = context.in_parallel("perturbation", &CASES, |_, case| {
        measure(context.config, case.scaled(context.config), context.seed)
    })?;

    let mut outcome = Outcome::default();
    let lost = |m: &StepResponse| format!("{}: {} of {SEEDS} runs lost", m.case.name, m.lost);
    outcome.faults = results.iter().filter(|m| m.lost > 0).map(lost).collect();
    let seeds = [("seeds", SEEDS as f64)];
    let mut table = texts::table_with("perturbation", "steps", &seeds);
    let is_load = |m: &&StepResponse| m.case.is_load();
    for m in &results {
        table.record([
            ("step", Cell::from(m.case.name)),
            ("peak (°)", Cell::fixed(peak(&m.angle), 2)),
            ("largest single error (°)", Cell::fixed(m.largest, 2)),
        ]);
    }
    outcome.tables.push(table);
    let most = |of: &dyn Fn(&StepResponse) -> f64, keep: &dyn Fn(&&StepResponse) -> bool| {
        results.iter().filter(keep).map(of).fold(0.0, f64::max)
    };
    let metrics = &mut outcome.metrics;
    metrics.set("load_step_error_max_deg", most(&|m| m.largest, &is_load));
    metrics.set("load_step_dip_rpm", most(&|m| peak(&m.speed).abs(), &is_load));
    let known = |m: &&StepResponse| !is_load(m) && m.case.warmer == 1.0;
    let warm = |m: &&StepResponse| m.case.warmer > 1.0;
    metrics.set("current_step_error_max_deg", most(&|m| m.largest, &known));
    metrics.set("current_step_warm_error_max_deg", most(&|m| m.largest, &warm));
    metrics.set("lost_runs", results.iter().map(|m| m.lost).sum::<usize>() as f64);

    let mut figure = texts::figure("perturbation", "perturbation");
    let mut speeds = texts::figure("perturbation", "speed");
    let line = |of: &[f64]| {
        let mean = |(n, c): (usize, &[f64])| {
            (n as f64 * 10.0 / RATE_HZ, c.iter().sum::<f64>() / c.len() as f64)
        };
        of.chunks(10).enumerate().map(mean).collect::<Vec<_>>()
    };
    let panel = |y: String, mean: &[f64]| {
        Panel::new("time after the step (s)", y).with(Series::line("measured", line(mean)))
    };
    for m in &results {
        let name = m.case.name;
        figure = figure.panel(panel(format!("{name} (°)"), &m.angle));
        if is_load(&m) {
            speeds = speeds.panel(panel(format!("{name} (rpm)"), &m.speed));
        }
    }
    outcome.figures.push(figure);
    outcome.figures.push(speeds);
    Ok(outcome)
}
