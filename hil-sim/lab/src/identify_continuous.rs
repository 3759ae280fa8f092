//! Models B, C, D and S on simulated measurements: Tables 2, 3 and 5 of Jacobina, Lima, Ribeiro
//! 1996.

use crate::identification::printed::{Case, SPEEDS};
use crate::identification::study::{Entry, MODELS, TRIALS, errors_of, tables};
use crate::identification::{Noise, Parameters, Signal, Trial};
use crate::prelude::*;

/// Runs the experiment: Tables 2, 3 and 5.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let (all, mut outcome) = tables(context, &MODELS)?;
    outcome.tables.push(means(&all, &mut outcome.metrics));
    let table = low_speeds(context.seed, &mut outcome);
    outcome.tables.push(table);
    let r_s = all.iter().filter(|e| {
        e.parameter == "r_s" && e.case.signal == Signal::Schroeder && e.case.period < 2
    });
    let times = Stats::of(r_s.filter_map(Entry::ratio).map(|ratio| 1.0 / ratio));
    outcome.metrics.set("r_s_with_ss_better_times_mean", times.mean());
    let slow = all.iter().filter(|e| e.case.speed == SPEEDS[1] && e.case.period == 0);
    for e in
        slow.filter(|e| ["B", "C"].contains(&e.model) && ["r_s", "tau_r"].contains(&e.parameter))
    {
        let key = format!("{}_{}_{}", e.case.signal.name(), e.model, e.parameter).to_lowercase();
        outcome.metrics.set(format!("slow_{key}_pct"), e.mean_pct);
    }
    Ok(outcome)
}

/// Speeds between standstill and 200 rad/s, electrical rad/s.
const LOW: [f64; 4] = [20.0, 61.0, 120.0, 200.0];
/// Slip at these speeds, rad/s.
const SLIP: f64 = 1.8;
/// Number of seeds of their mean.
const SWEEPS: u64 = 8;

/// Tests the claim of section 5 that Model C is as good as Model B from 0 to 200 rad/s.
fn low_speeds(seed: u64, outcome: &mut Outcome) -> Table {
    let mut table = texts::table("identify-continuous", "low_speeds");
    let mut similar = true;
    for speed in LOW {
        let case = Case { speed, signal: Signal::Schroeder, period: 0 };
        let hz = (speed + SLIP) / std::f64::consts::TAU;
        let machine = Parameters::PX.at(speed);
        let trial = Trial { hz, ..Trial::printed(machine, case.signal, case.h(), Noise::HALF) };
        let runs: Vec<_> = (0..SWEEPS).map(|n| errors_of(&trial, case, seed + n, TRIALS)).collect();
        let mean = |model: usize, k: usize| {
            Stats::of(runs.iter().map(|run| run.continuous[model][k])).mean()
        };
        for (k, name) in Parameters::NAMES.into_iter().enumerate() {
            let (b, c) = (mean(0, k), mean(1, k));
            similar &= c < 1.5 * b;
            table.record([
                ("speed (rad/s)", Cell::fixed(speed, 0)),
                ("parameter", Cell::from(name)),
                ("B (%)", Cell::significant(b, 3)),
                ("C (%)", Cell::significant(c, 3)),
                ("C over B", Cell::fixed(c / b, 2)),
            ]);
        }
    }
    outcome.compared.push(named("c_similar_to_b").simulated(similar));
    table
}

/// Computes means over the twelve columns.
fn means(all: &[Entry], metrics: &mut Metrics) -> Table {
    let heads = ["model", "r_s (%)", "τ_r (%)", "σ l_s (%)", "l_s (%)", "ω_m (%)"];
    let mut table = Table::new("Mean of both signals, speeds and all periods", &heads);
    for model in MODELS {
        let mean = |parameter: &str| {
            let of = |e: &Entry| e.model == model && e.parameter == parameter;
            Stats::of(all.iter().filter(|e| of(e)).map(|e| e.ours_pct)).mean()
        };
        let means = Parameters::NAMES.map(mean);
        let key = model.to_lowercase();
        for (parameter, mean) in Parameters::NAMES.iter().zip(means) {
            metrics.set(format!("model_{key}_{parameter}_pct"), mean);
        }
        table.row([Cell::from(model)].into_iter().chain(means.map(|mean| Cell::fixed(mean, 2))));
    }
    table.note("Half the printed noise. If no measurement gives a number, it counts as 100 %.")
}
