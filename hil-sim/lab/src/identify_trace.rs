//! Identification of the motor from a recorded trace of a drive: voltages, currents and speed in a CSV file.

mod file;

use std::path::Path;

use crate::identification::output_error::{OutputErrorFit, Record};
use crate::identification::{Complex, NotIdentifiable, Parameters};
use crate::prelude::*;

use file::LINE_TO_PHASE;
pub(crate) use file::{Contents, read};
pub use file::{Reading, Voltages};

/// Remark on an inverter voltage error at its bound.
const BOUND: &str = "The inverter voltage error would be negative, which is impossible, so it is set to 0. Are the voltages those of the \
                     terminals (--voltages sampled or mean)?";
/// Starts of the fit: factors for the resistance and for the inductances of the settings.
const STARTS: [f64; 3] = [1.0, 0.2, 5.0];
/// Largest deviation of a parameter, relative to the parameter, and largest residual, relative to the current, with
/// which a record determines the motor.
const OPEN: f64 = 0.3;
/// Residual, relative to the current, above which a remark mentions it.
const REMARKED: f64 = 0.05;
/// Smallest relative change of the current that a doubled rotor time constant must cause. With less, errors of the
/// record of a few percent, such as harmonics and iron loss, exceed the information in the slip.
const TOLD: f64 = 0.1;
/// Share to which the residual must fall before the voltages are taken for line-to-line voltages.
const NEARER: f64 = 0.3;
/// Number of parts in which supply frequency and speed are compared, and largest relative difference in a match.
const SPEEDS: usize = 20;
const MATCH: f64 = 0.1;
/// Share of the pull-out slip above which a motor does not run in most of a record.
const RUNNING: f64 = 0.5;
/// Largest number of pole pairs that is tried.
const MOST_PAIRS: u32 = 6;

/// Returns the machine of the settings, as its terminals show it.
fn settings(config: &Config) -> Parameters {
    let m = &config.motor;
    let (l_s, l_r) = (m.l_m + m.l_ls, m.l_m + m.l_lr);
    let sigma_l_s = l_s - m.l_m * m.l_m / l_r;
    Parameters { r_s: m.r_s, tau_r: l_r / m.r_r, sigma_l_s, l_s, omega_m: 0.0 }
}

/// Fits the machine to a record and returns the best of all starts.
fn nearest_machine(
    record: &Record,
    start: &Parameters,
    drop_v: Option<f64>,
) -> Result<OutputErrorFit, NotIdentifiable> {
    let from = |factor: &f64| {
        let Parameters { r_s, sigma_l_s, l_s, .. } = *start;
        let [r_s, sigma_l_s, l_s] = [r_s, sigma_l_s, l_s].map(|value| value * factor);
        record.fit(&Parameters { r_s, sigma_l_s, l_s, ..*start }, drop_v)
    };
    let left =
        |fit: &Result<_, _>| fit.as_ref().map_or(f64::MAX, |it: &OutputErrorFit| it.residual_a);
    let fits: Vec<_> = STARTS.par_iter().map(from).collect();
    let nearest = fits.into_iter().min_by(|a, b| left(a).total_cmp(&left(b)));
    nearest.unwrap_or(Err(NotIdentifiable::NotConverged))
}

/// Returns the magnitude of a current, rms.
pub(crate) fn rms(current: &[Complex]) -> f64 {
    (current.iter().map(Complex::norm_sqr).sum::<f64>() / current.len() as f64).sqrt()
}

/// Returns the reason why a fit does not count; none if it counts.
fn fault(fit: &OutputErrorFit, current_a: f64) -> Option<String> {
    let [share, told] = [fit.residual_a, fit.told_a[1]].map(|a| 100.0 * a / current_a);
    let values = fit.parameters.array();
    let open = (0..4).find(|&n| fit.deviations[n] > OPEN * values[n]);
    match open {
        _ if share > 100.0 * OPEN => {
            Some(format!("the best machine does not explain {share:.0} % of the current"))
        }
        _ if told < 100.0 * TOLD => Some(format!(
            "no load: the slip is too small to determine the rotor time constant; if it were doubled, the current would change \
             by {told:.1} %, and {:.0} % are needed",
            100.0 * TOLD
        )),
        _ if !fit.converged => Some(NotIdentifiable::NotConverged.to_string()),
        Some(n) => {
            let (name, value, deviation) = (Parameters::NAMES[n], values[n], fit.deviations[n]);
            Some(format!("it does not determine {name}: {value:.3e} ± {deviation:.1e}, SI units"))
        }
        None => None,
    }
}

/// Identifies the motor from a CSV file with the columns `time_s`, `speed_rpm`, and `u_alpha_v`, `u_beta_v`, `i_alpha_a`,
/// `i_beta_a` or `u_a_v`, `u_b_v`, `u_c_v`, `i_a_a`, `i_b_a`, `i_c_a`, of which phase c may be absent, or the line-to-line
/// voltages `u_ab_v`, `u_bc_v`, `u_ca_v`.
///
/// # Errors
/// [`Error::Data`] with the line; [`Error::Refused`] for a wrong mapping, and if the record does not determine the
/// motor, with the likely reason.
pub fn identify(path: &Path, reading: &Reading, config: &Config) -> Result<Outcome, Error> {
    let Contents { record, mut remarks, channels } = read(path, reading, config)?;
    let refused = |why: String| {
        let path = path.display();
        Error::Refused(format!("{path}: the record does not determine the motor: {why}"))
    };
    let expected = settings(config);
    if let Some(why) = misread_speed(&record, &expected, config.motor.pole_pairs) {
        return Err(refused(why));
    }
    // In electrical radians: an offset of the speed does not count as rotation.
    let speed = (record.omega_m.iter().map(|w| w * w).sum::<f64>() / record.i.len() as f64).sqrt();
    if speed * record.h * (record.i.len() as f64) < TAU {
        let why = "the shaft does not turn; a locked rotor shows neither L_s nor the time constant at small slip";
        return Err(refused(why.to_owned()));
    }
    let terminals = reading.voltages != Voltages::Commanded;
    let drop_v = reading.drop_v.or(terminals.then_some(0.0));
    let nearest = |record: &Record| nearest_machine(record, &expected, drop_v);
    let (current_a, mut fit) =
        (rms(&record.i), nearest(&record).map_err(|why| refused(why.to_string()))?);
    if let Some(why) = fault(&fit, current_a) {
        let v = record.v.iter().map(|v| v / LINE_TO_PHASE).collect();
        let lines = nearest(&Record { v, ..record });
        let are_lines = lines.is_ok_and(|it| it.residual_a < NEARER * fit.residual_a);
        let hint =
            "; the voltages look like those from line to line: call them u_ab_v, u_bc_v, u_ca_v";
        return Err(refused(why + if are_lines { hint } else { "" }));
    }
    if drop_v.is_none() && fit.drop_v == 0.0 {
        remarks.push(BOUND.to_owned());
    }
    if channels > 0 {
        let skew_s = record.h / channels as f64;
        let skewed = Reading { skew_s: Some(skew_s), ..reading.clone() };
        let other = read(path, &skewed, config)?.record.fit(&fit.parameters, drop_v);
        let other = other.map_err(|why| refused(format!("with another skew: {why}")))?;
        let [here, there] = [&fit, &other].map(|fit| fit.parameters.array());
        for n in 0..4 {
            fit.deviations[n] = fit.deviations[n].hypot(there[n] - here[n]);
        }
        remarks.push(format!(
            "Whether the {channels} channels were sampled at once is not known. ± contains the change if they were sampled one after \
             another, {:.1} µs apart. If you know their distance, give it with --skew; 0 is at once.",
            1e6 * skew_s
        ));
    }
    Ok(outcome(&record, &fit, &expected, remarks, config))
}

/// Returns how the speed looks if its slip is that of a motor about to stall and another unit, sense or number of pole pairs
/// agrees with the supply frequency.
fn misread_speed(record: &Record, machine: &Parameters, pole_pairs: u32) -> Option<String> {
    let rows = record.i.len().div_ceil(SPEEDS);
    let parts = record.i.chunks(rows).zip(record.omega_m.chunks(rows));
    let speeds: Vec<[f64; 2]> = parts
        .map(|(i, omega_m)| {
            let turn: Complex = i.windows(2).map(|pair| pair[0].conj() * pair[1]).sum();
            [turn.arg() / record.h, omega_m.iter().sum::<f64>() / omega_m.len() as f64]
        })
        .collect();
    let mut slips: Vec<f64> = speeds.iter().map(|[supply, speed]| (supply - speed).abs()).collect();
    slips.sort_by(f64::total_cmp);
    let pull_out = machine.l_s / machine.sigma_l_s / machine.tau_r;
    if slips[slips.len() / 2] < RUNNING * pull_out {
        return None;
    }
    let sum = |n: usize| speeds.iter().map(|pair| pair[0] * pair[n]).sum::<f64>();
    let (share, supply) = (sum(1) / sum(0), (sum(0) / speeds.len() as f64).sqrt());
    let of_pairs = |pairs: u32| match pairs {
        1 => "electrical, or the motor has 1 pole pair".to_owned(),
        _ => format!("that of a motor with {pairs} pole pairs"),
    };
    let units = [
        (60.0 / TAU, "in rad/s"),
        (60.0, "in turns per second"),
        (-1.0, "of opposite sign, or two phases are exchanged"),
    ];
    let units = units.map(|(factor, what)| (factor, what.to_owned())).into_iter();
    let pairs = (1..=MOST_PAIRS).map(|n| (f64::from(n) / f64::from(pole_pairs), of_pairs(n)));
    let apart = |factor: f64| (factor * share - 1.0).abs();
    let nearest = units.chain(pairs).min_by(|a, b| apart(a.0).total_cmp(&apart(b.0)));
    let (_, what) = nearest.filter(|(factor, _)| apart(*factor) < MATCH)?;
    let [supply_hz, speed_hz] = [supply, share * supply].map(|speed| speed / TAU);
    Some(format!(
        "the current rotates at {supply_hz:.1} Hz, and the speed with {pole_pairs} pole pairs is {speed_hz:.1} Hz; the speed seems \
         to be {what}"
    ))
}

fn outcome(
    record: &Record,
    fit: &OutputErrorFit,
    expected: &Parameters,
    remarks: Vec<String>,
    config: &Config,
) -> Outcome {
    let mut outcome = Outcome { remarks, ..Outcome::default() };
    let p = &fit.parameters;
    let rows = [
        ("stator resistance r_s", "r_s", "ohm", p.r_s, expected.r_s, 1.0),
        ("rotor time constant τ_r", "tau_r", "s", p.tau_r, expected.tau_r, 1.0),
        ("transient inductance σL_s", "sigma_l_s", "mH", p.sigma_l_s, expected.sigma_l_s, 1e3),
        ("stator inductance L_s", "l_s", "mH", p.l_s, expected.l_s, 1e3),
        ("inverter voltage error", "drop", "V", fit.drop_v, f64::NAN, 1.0),
    ];
    let share = fit.residual_a / rms(&record.i);
    let mut table = Table::new("Identified motor", &[]).note(format!(
        "{} rows of {:.1} µs. ±: standard deviation between parts of the record, and the effect of an unknown skew; errors of the scale of voltage, current or speed are \
         not included. Residual: {:.1} % of the current. Settings: {}.",
        record.i.len(),
        1e6 * record.h,
        100.0 * share,
        config.motor_text()
    ));
    for ((label, name, unit, found, set, scale), deviation) in rows.into_iter().zip(fit.deviations)
    {
        let of_settings = |cell: Cell| if set.is_nan() { Cell::from("–") } else { cell };
        table.record([
            ("parameter", Cell::from(label)),
            ("unit", Cell::from(unit)),
            ("identified", Cell::significant(scale * found, 4)),
            ("±", Cell::significant(scale * deviation, 2)),
            ("settings", of_settings(Cell::significant(scale * set, 4))),
            ("difference (%)", of_settings(Cell::fixed(100.0 * (found / set - 1.0), 1))),
        ]);
        let unit = unit.to_lowercase();
        outcome.metrics.set(format!("{name}_{unit}"), scale * found);
        outcome.metrics.set(format!("{name}_deviation_{unit}"), scale * deviation);
    }
    outcome.metrics.set("residual_rms_a", fit.residual_a);
    outcome.metrics.set("residual_percent", 100.0 * share);
    outcome.tables.push(table);
    let line = |of: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..record.i.len()).map(|k| (k as f64 * record.h, of(k))).collect()
    };
    let difference = |k: usize| record.i[k] - fit.current[k];
    let current = Panel::new("time (s)", "current α (A)")
        .with(Series::line("recorded", line(&|k| record.i[k].re)))
        .with(Series::reference("identified motor", line(&|k| fit.current[k].re)));
    let apart = Panel::new("time (s)", "difference (A)")
        .with(Series::line("α", line(&|k| difference(k).re)))
        .with(Series::line("β", line(&|k| difference(k).im)));
    outcome.figures.push(texts::figure("identify-trace", "trace").panel(current).panel(apart));
    if share > REMARKED {
        outcome.remark(
            "The residual is large: harmonics, saturating leakage inductances, or a wrong scale.",
        );
    }
    texts::add_remarks(&mut outcome, "identify-trace", &[]);
    outcome
}
