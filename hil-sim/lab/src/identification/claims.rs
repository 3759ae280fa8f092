//! The claims of section 5 about Tables 1 to 5, counted in the tables themselves and in ours.

use super::printed::{Case, PERIODS, SPEEDS, error};
use super::signals::{TONE_AMPLITUDE, TONES};
use super::study::{Entry, TRIALS, errors};
use super::trial::{FINE, ORDER};
use super::{CurrentVoltage, Noise, Parameters, Signal, Trial, model_c};
use crate::prelude::*;

/// A row of the tables: model, speed, parameter.
type Row = (&'static str, f64, &'static str);
/// Error of a model in a column by the name of the parameter, %.
type Errors<'a> = &'a dyn Fn(&str, Case, &str) -> f64;

fn rows(model: &'static str, speed: f64) -> Vec<Row> {
    let names: &[&'static str] =
        if model == "A" { &CurrentVoltage::NAMES } else { &Parameters::NAMES };
    names.iter().map(|name| (model, speed, *name)).collect()
}

/// Errors of a row for the periods, %.
fn over_h(of: Errors<'_>, (model, speed, name): Row, signal: Signal) -> [f64; 3] {
    [0, 1, 2].map(|period| of(model, Case { speed, signal, period }, name))
}

/// Smallest and largest error at 50 µs, without the rows in `not`.
fn at_50(of: Errors<'_>, rows: &[Row], signals: &[Signal], not: &[&str]) -> (f64, f64) {
    let used = rows.iter().filter(|row| !not.contains(&row.2));
    let all = used.flat_map(|&row| signals.iter().map(move |&signal| over_h(of, row, signal)[0]));
    all.fold((f64::MAX, 0.0), |(least, most), error| (least.min(error), most.max(error)))
}

/// Whether each claim holds, and the numbers on which the errata are based.
type Found = ([(&'static str, bool); 9], [(&'static str, f64); 9]);

/// Adds the claims by the printed tables and by ours, and the numbers of the printed ones.
pub fn add(seed: u64, compared: &mut Vec<Compared>, metrics: &mut Metrics) {
    let column = |case| errors(Parameters::PX, case, Noise::HALF, seed, TRIALS);
    let columns = Case::all().into_iter().map(column);
    let entries: Vec<Entry> = columns.flat_map(|c| c.entries(&["A", "B", "C"])).collect();
    let ours = |model: &str, case: Case, name: &str| {
        let is_it = |e: &&Entry| e.model == model && e.case == case && e.parameter == name;
        entries.iter().find(is_it).map_or(f64::NAN, |entry| entry.ours_pct)
    };
    let printed = |model: &str, case, name: &str| error(model, case, name).unwrap_or(f64::NAN);
    let (claims, numbers) = found(&printed);
    for ((name, by_print), (_, by_ours)) in claims.into_iter().zip(found(&ours).0) {
        compared.push(named(name).of_print(by_print).simulated(by_ours));
    }
    for (name, value) in numbers {
        metrics.set(name, value);
    }
    compared.extend(settings());
    // Eq. 42 and Model C on the exact coefficients.
    for (h, micros) in PERIODS.iter().zip([50, 100, 200]) {
        let low_by = |machine: Parameters, k: usize| {
            let machine = machine.at(SPEEDS[0]);
            let found = model_c(&machine.continuous().series(*h, 5).current_voltage().delta(), *h);
            100.0 * (1.0 - found.array()[k].unwrap_or(f64::NAN) / machine.array()[k])
        };
        metrics.set(format!("eq_42_low_by_at_{micros}_us_pct"), low_by(Parameters::PX, 4));
        let bias = low_by(Parameters::RBV, 1).abs();
        metrics.set(format!("model_c_tau_r_bias_of_rbv_at_{micros}_us_pct"), bias);
    }
}

/// Compares the settings of the simulated measurements with the printed ones.
fn settings() -> [Compared; 15] {
    let [fast, slow] = SPEEDS.map(|speed| {
        Trial::printed(Parameters::PX.at(speed), Signal::SixStep, PERIODS[0], Noise::PRINTED)
    });
    #[rustfmt::skip] // a setting a line
    let settings = [
        ("section 4", "K, tones of the Schroeder signal", TONES.into()),
        ("section 4", "amplitude of a tone, share of max(S_g)", TONE_AMPLITUDE),
        ("section 5", "step of the simulation", 1e6 * FINE),
        ("section 5", "order of the series", ORDER.into()),
        ("section 5", "r_v", fast.noise.voltage),
        ("section 5", "r_i", fast.noise.current),
        ("section 5", "N, samples of a measurement", fast.samples as f64),
        ("section 5", "M, measurements", TRIALS as f64),
        ("section 5", "h_1", 1e6 * PERIODS[0]),
        ("section 5", "h_2", 1e6 * PERIODS[1]),
        ("section 5", "h_3", 1e6 * PERIODS[2]),
        ("Tables 1 to 3", "f_s", fast.hz),
        ("Tables 1 to 3", "speed", fast.machine.omega_m),
        ("Tables 4 and 5", "f_s", slow.hz),
        ("Tables 4 and 5", "speed", slow.machine.omega_m),
    ];
    source::used("S0", settings)
}

fn found(of: Errors<'_>) -> Found {
    let [fast, slow] = SPEEDS;
    let tables = [("A", fast), ("A", slow), ("B", fast), ("C", fast), ("C", slow)];
    let [a_fast, a_slow, _, c_fast, c_slow] = tables.map(|(model, speed)| rows(model, speed));
    let all: Vec<_> = tables.into_iter().flat_map(|(model, speed)| rows(model, speed)).collect();
    let errors = all.iter().map(|&row| Signal::ALL.map(|signal| over_h(of, row, signal)));
    let pairs = errors.clone().flat_map(|[sg, ss]| [0, 1, 2].map(|k| ss[k] < sg[k]));
    let steps = errors.flatten().flat_map(|e| [e[1] > e[0], e[2] > e[1]]);
    let count = |all: &mut dyn Iterator<Item = bool>| all.filter(|holds| *holds).count();
    let (better, pairs) = (count(&mut pairs.clone()), pairs.count());
    let (grow, steps) = (count(&mut steps.clone()), steps.count());

    let (unseen, ss) = (["h_1b", "h_0b"], [Signal::Schroeder]);
    let (_, discrete) = at_50(of, &a_fast, &Signal::ALL, &unseen);
    let (_, continuous) = at_50(of, &c_fast, &Signal::ALL, &["r_s"]);
    let (least, most) = at_50(of, &a_slow, &ss, &unseen);
    let (_, c_most) = at_50(of, &c_slow, &ss, &["r_s"]);
    let r_s = over_h(of, ("C", slow, "r_s"), Signal::Schroeder)[0];
    let h_1b = Signal::ALL.map(|signal| over_h(of, ("A", fast, "h_1b"), signal)[0]);
    let claims = [
        ("h_1b_estimated", h_1b.iter().all(|error| *error < 100.0)),
        ("ss_better", 2 * better > pairs),
        ("errors_grow", 2 * grow > steps),
        ("discrete_fast", discrete < 1.0),
        ("discrete_slow", most < 10.0),
        ("smallest_slow", least < 1.0),
        ("continuous_fast", continuous < 4.0),
        ("continuous_slow", c_most < 6.0),
        ("r_s_slow", r_s <= 20.0),
    ];

    // f_1b and the speed are proportional (Eq. 42).
    let f_1b = Signal::ALL.map(|signal| over_h(of, ("A", fast, "f_1b"), signal));
    let [b, c] = ["B", "C"]
        .map(|model| Signal::ALL.map(|signal| over_h(of, (model, fast, "omega_m"), signal)));
    let over = |x: [[f64; 3]; 2], y: [[f64; 3]; 2], of: fn(f64, f64) -> f64| {
        x.as_flattened().iter().zip(y.as_flattened()).map(|(x, y)| of(*x, *y)).fold(0.0, f64::max)
    };
    let at = |model, name| over_h(of, (model, slow, name), Signal::Schroeder)[0];
    let numbers = [
        ("pairs_better_with_ss", better as f64),
        ("pairs", pairs as f64),
        ("steps_of_h_that_raise", grow as f64),
        ("steps_of_h", steps as f64),
        ("table_4_f_1b_over_table_5_omega_m", at("A", "f_1b") / at("C", "omega_m")),
        ("omega_m_of_b_less_c_pct", over(b, c, |b, c| (b - c).abs())),
        ("f_1b_over_omega_m", over(f_1b, c, |f, c| f / c)),
        ("procedure_discrete_pct", discrete),
        ("procedure_continuous_pct", continuous),
    ];
    (claims, numbers)
}
