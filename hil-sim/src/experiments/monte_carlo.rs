//! Statistics of the angle error over random operating points.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::steady::{OperatingPoint, SteadyRun, steady_run};
use super::torque::assumptions;
use super::{BENCH, Context, DRIVE, Experiment, FREE_SHAFT, SPEED_LOOP};
use crate::config::Config;
use crate::config::plant_settings;
use crate::error::Error;
use crate::outcome::{Cell, Figure, Outcome, Panel, Series, Table};

/// Not a figure of the source: the claim behind Figures 38 and 39, over many runs.
pub const EXPERIMENT: Experiment = Experiment {
    name: "monte-carlo",
    stands_for: "the claim behind Figures 38 and 39",
    about: "Random torque current (a seventh to six sevenths of the limit, both signs) and speed, and what `spread.*` adds; `--set runs=N`.",
    uses: &[
        BENCH,
        DRIVE,
        &[
            "load.speed_rpm",
            "prepare.learn",
            "spread.motor",
            "spread.noise",
            "spread.gain",
            "runs",
            "seconds",
        ],
    ],
    not: &[FREE_SHAFT, SPEED_LOOP],
    run,
};

const RUNS: u32 = 200;
/// How many of the worst runs are listed.
const WORST: usize = 10;
/// Torque currents on the dissertation's motor, A.
const IQ_A: (f64, f64) = (0.5, 3.0);
/// Speeds up to here on four poles, rpm, unless `load.speed_rpm` says otherwise.
const SPEED_RPM: f64 = 150.0;

fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let runs = context.config.extent.runs.unwrap_or(RUNS);
    let bound = context.config.load.speed_rpm.abs();
    let bound = if bound > 0.0 { bound } else { context.config.rpm(SPEED_RPM) };
    let (least, most) = (context.config.amperes(IQ_A.0), context.config.amperes(IQ_A.1));
    let cases: Vec<(OperatingPoint, Config)> = (0..u64::from(runs))
        .map(|number| {
            // A generator of its own for every run: each can be repeated alone by its seed.
            let seed = context.seed.wrapping_mul(1_000_003).wrapping_add(number);
            let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
            let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
            let iq = sign * random.random_range(least..=most);
            let case = OperatingPoint { rpm: random.random_range(-bound..=bound), iq, seed };
            (case, spread(context.config, &mut random))
        })
        .collect();
    let results = context.in_parallel("monte-carlo", &cases, |_, (case, config)| {
        steady_run(config, *case, context.seconds.unwrap_or(2.0))
    })?;

    let mut outcome = Outcome::default();
    outcome.faults.extend(results.iter().filter_map(SteadyRun::lost_text));
    let kept: Vec<(&OperatingPoint, &SteadyRun)> =
        cases.iter().map(|(case, _)| case).zip(&results).filter(|(_, r)| !r.lost).collect();
    let mut largest: Vec<f64> = kept.iter().map(|(_, r)| r.error.largest()).collect();
    largest.sort_by(f64::total_cmp);
    let squares = kept.iter().map(|(_, r)| r.error.rms().powi(2)).sum::<f64>();
    let m = &mut outcome.metrics;
    m.set("angle_error_rms_deg", (squares / kept.len() as f64).sqrt());
    m.set("worst_run_rms_deg", kept.iter().map(|(_, r)| r.error.rms()).fold(0.0, f64::max));
    m.set("angle_error_max_deg", largest.last().copied().unwrap_or(f64::NAN));
    // The smallest bound that 99 % of the runs stay below.
    let p99 = (largest.len() * 99).div_ceil(100).saturating_sub(1);
    m.set("run_max_p99_deg", largest.get(p99).copied().unwrap_or(f64::NAN));
    m.set("lost_runs", (results.len() - kept.len()) as f64);
    m.set("runs", results.len() as f64);

    let mut table = Table::new("Lost runs", &["seed", "iq (A)", "speed (rpm)"]);
    for ((case, _), _) in cases.iter().zip(&results).filter(|(_, r)| r.lost) {
        table.row([
            Cell::from(case.seed.to_string()),
            Cell::fixed(case.iq, 3),
            Cell::fixed(case.rpm, 1),
        ]);
    }
    if !table.rows.is_empty() {
        outcome.tables.push(table);
    }
    let heads = ["seed", "iq (A)", "speed (rpm)", "rms (°)", "mean (°)", "largest (°)"];
    let mut table = Table::new("Worst runs", &heads);
    let mut by_rms = kept.clone();
    by_rms.sort_by(|a, b| b.1.error.rms().total_cmp(&a.1.error.rms()));
    for (case, run) in by_rms.iter().take(WORST) {
        table.row([
            Cell::from(case.seed.to_string()),
            Cell::fixed(case.iq, 3),
            Cell::fixed(case.rpm, 1),
            Cell::fixed(run.error.rms(), 2),
            Cell::fixed(run.error.mean(), 2),
            Cell::fixed(run.error.largest(), 2),
        ]);
    }
    outcome.tables.push(table);
    let points = |of: fn(&SteadyRun) -> f64| kept.iter().map(|(c, r)| (c.iq, of(r))).collect();
    outcome.figures.push(
        Figure::new("runs", "Angle error of every run over its torque current", "").panel(
            Panel::new("quadrature current (A)", "angle error (°)")
                .with(Series::points("largest", points(|r| r.error.largest())))
                .with(Series::points("rms", points(|r| r.error.rms())))
                .with(Series::points("mean", points(|r| r.error.mean()))),
        ),
    );
    outcome.remarks = assumptions(context.config);
    outcome.remarks.push(format!(
        "Speeds within ±{bound} rpm. Lost: beyond 45° at any time, or stopped by the drive; lost \
         runs are in no other figure."
    ));
    Ok(outcome)
}

/// The configuration with the errors of `spread` drawn at random.
fn spread(config: &Config, random: &mut Xoshiro256PlusPlus) -> Config {
    let mut drawn = config.clone();
    let mut factor = |largest: f64| 1.0 + random.random_range(-largest..=largest);
    let (spread, motor) = (&config.spread, &mut drawn.drive.motor);
    for place in [&mut motor.r_s, &mut motor.r_r, &mut motor.l_ls, &mut motor.l_lr, &mut motor.l_m]
    {
        *place = (f64::from(*place) * factor(spread.motor)) as f32;
    }
    let noise_a = plant_settings(config).measurement.noise_a;
    drawn.measurement.noise_a = Some(noise_a * factor(spread.noise));
    drawn.measurement.gain_error_a += factor(spread.gain) - 1.0;
    drawn.measurement.gain_error_b += factor(spread.gain) - 1.0;
    drawn
}
