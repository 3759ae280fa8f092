//! The recursive form of drive-core on simulated measurements: Figures 2 to 4 of Jacobina, Lima, Ribeiro 1996.

use rotor_id::rls::{Rls, RlsSettings};

use crate::identification::signals::noise;
use crate::identification::trial::{CORNER, Noise, VOLTAGE, peaks};
use crate::identification::{Complex, Delta, Parameters, Signal, Trial, Value, model_c};
use crate::prelude::*;
use crate::recomputed::both;

const H: f64 = 50e-6;
const RATE: usize = 20_000;
/// Base current, A.
const CURRENT: f64 = 30.0;
/// Samples between points of the figures.
const EVERY: usize = 100;

/// Figure, signal, speed (electrical rad/s), convergence times that the paper gives (s).
const CASES: [(&str, Signal, f64, Option<f64>); 3] = [
    ("Figure 2", Signal::SixStep, 366.0, Some(0.2)),
    ("Figure 3", Signal::SixStep, 57.6, Some(0.8)),
    ("Figure 4", Signal::Schroeder, 57.6, None),
];

/// Parameters by Model C at every sample.
type Estimates = Vec<[Value; 5]>;

fn estimate(trial: &Trial, level: Noise, seconds: f64, seed: u64) -> Result<Estimates, Error> {
    let corner = CORNER * TAU * trial.hz;
    let paper = RlsSettings::paper(VOLTAGE as f32, CURRENT as f32);
    let settings = RlsSettings { corner: (corner * H) as f32, ..paper };
    let mut rls = Rls::new(settings)
        .map_err(|_| Error::Internal("a setting of the least squares is out of range".into()))?;
    let peak = peaks(trial.raw().skip(RATE).take(RATE / 5));
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut estimates = Vec::new();
    for (v, i) in trial.raw().skip(RATE).take((seconds * RATE as f64) as usize) {
        let v = v + noise(&mut rng, level.voltage * peak[0]);
        let i = i + noise(&mut rng, level.current * peak[1]);
        let narrow = |x: Complex| AlphaBeta { alpha: x.re as f32, beta: x.im as f32 };
        rls.step(narrow(v), narrow(i));
        let theta = rls.latest().map(|x| Complex::new(x.re.into(), x.im.into()));
        estimates.push(model_c(&Delta::from_array(theta), H).array());
    }
    Ok(estimates)
}

/// Time after which a parameter stays within 10 % of its final value, s, by a moving median over 20 ms.
fn convergence(estimates: &[[Value; 5]], k: usize) -> f64 {
    let of = |range: std::ops::Range<usize>| {
        let values = sorted(estimates[range].iter().map(|e| e[k].unwrap_or(0.0)));
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    let end = of(estimates.len() * 3 / 4..estimates.len());
    let outside = |n: &usize| (of(n - 400..*n) / end - 1.0).abs() > 0.1;
    let last = (400..estimates.len()).step_by(40).rfind(outside);
    last.unwrap_or(0) as f64 / RATE as f64
}

/// Runs the experiment: Figures 2 to 4.
///
/// # Errors
/// If the configuration or the drive is refused.
pub fn run(context: &Context<'_>) -> Result<Outcome, Error> {
    let seconds = context.seconds.unwrap_or(2.0).clamp(0.2, 60.0);
    let mut outcome = Outcome::default();
    let mut table = texts::table("identify-recursive", "convergence");
    let mut slowest = [0.0; CASES.len()];
    let bar = context.progress.bar("identification", 2 * CASES.len() as u64);
    for (index, (source, signal, speed, paper)) in CASES.into_iter().enumerate() {
        let machine = Parameters::PX.at(speed);
        let trial = Trial::printed(machine, signal, H, Noise::NONE);
        let clean = estimate(&trial, Noise::NONE, seconds, context.seed)?;
        bar.inc(1);
        let noisy = estimate(&trial, Noise::TENTH, seconds, context.seed)?;
        bar.inc(1);
        let times = [0, 1].map(|k| convergence(&clean, k));
        slowest[index] = times[0].max(times[1]);
        table.record([
            ("figure", Cell::from(source)),
            ("signal", Cell::from(signal.name())),
            ("speed (rad/s)", Cell::fixed(speed, 1)),
            ("r_s converges (s)", Cell::fixed(times[0], 3)),
            ("τ_r converges (s)", Cell::fixed(times[1], 3)),
            ("paper, worst (s)", Cell::or_dash(paper.map(|paper| Cell::fixed(paper, 1)))),
        ]);
        if paper.is_some() {
            let quantity = "convergence time of r_s and tau_r, the slowest, Sg";
            let unknown = "the noise of the measurement and when a parameter counts as converged";
            let place = Compared::with("S0", source, quantity).unknown(unknown);
            outcome.compared.push(place.simulated(slowest[index]));
        }
        let key = format!("figure_{}", index + 2);
        outcome.metrics.set(format!("{key}_r_s_converges_s"), times[0]);
        outcome.metrics.set(format!("{key}_tau_r_converges_s"), times[1]);
        outcome.figures.push(figure(&key, source, &trial, &noisy, paper));
        // The ordinates of the paper hold for its own machine.
        let trial = Trial { machine: Parameters::RBV.at(speed), ..trial };
        let theirs = estimate(&trial, Noise::TENTH, seconds, context.seed)?;
        let key = format!("{key}_table_6");
        outcome.figures.push(figure(&key, source, &trial, &theirs, paper));
    }
    outcome.compared.extend([
        named("sg_converges_later").simulated(slowest[1] > slowest[2]),
        named("slow_converges_later").simulated(slowest[1] > slowest[0]),
    ]);
    outcome.tables.push(table);
    let paper = RlsSettings::paper(1.0, 1.0);
    outcome.compared.extend(source::used(
        "S0",
        [
            ("Eq. 44", "omega_n/omega_s", both(CORNER, paper.corner / (TAU * 60.0 * H) as f32)),
            ("section 6", "h", 1e6 * H),
            ("section 6", "lambda", paper.lambda.into()),
        ],
    ));
    let covariance = Compared::with("S0", "section 6", "initial covariance over I");
    outcome.compared.push(covariance.unknown("the units of voltage and current"));
    Ok(outcome)
}

fn figure(
    name: &str,
    source: &str,
    trial: &Trial,
    estimates: &[[Value; 5]],
    paper: Option<f64>,
) -> Figure {
    let machine = &trial.machine;
    let of = if machine.r_s == Parameters::RBV.r_s { ", the machine of Table 6" } else { "" };
    let title = format!("Model C with {} at {} rad/s{of}", trial.signal.name(), machine.omega_m);
    let labels = ["r_s (Ω)", "τ_r (s)", "σ l_s (H)", "l_s (H)", "speed (electrical rad/s)"];
    let end = estimates.len() as f64 * H;
    let mut figure = Figure::new(name, title, source);
    for (k, label) in labels.into_iter().enumerate() {
        let truth = machine.array()[k];
        let points = estimates.iter().enumerate().step_by(EVERY);
        let points = points.map(|(n, e)| (n as f64 * H, e[k].unwrap_or(f64::NAN))).collect();
        let printed = paper.map(|t| vec![(t, 0.0), (t, 2.0 * truth)]).unwrap_or_default();
        let panel = Panel::new("time (s)", label)
            .y_range(0.0, 2.0 * truth)
            .with(Series::line("estimate", points))
            .with(Series::reference("machine", vec![(0.0, truth), (end, truth)]))
            .with(Series::limit("printed convergence", printed));
        figure = figure.panel(panel);
    }
    figure
}
