//! Identification of the motor from a recorded trace of a drive: voltages, currents and speed in a CSV file.

use std::path::Path;

use drive_settings::words;
use sim_bench::columns::Columns;
use sim_bench::error::{cut, unknown};
use sim_bench::plant::clarke;

use crate::identification::output_error::{OutputErrorFit, Record};
use crate::identification::{Complex, NotIdentifiable, Parameters};
use crate::prelude::*;

const TIME: &str = "time_s";
const SPEED: &str = "speed_rpm";
/// Columns of voltages and currents, as vectors or per phase. The third phase may be absent.
const VECTORS: [&[&str]; 2] = [&["u_alpha_v", "u_beta_v"], &["i_alpha_a", "i_beta_a"]];
const PHASES: [&[&str]; 2] = [&["u_a_v", "u_b_v", "u_c_v"], &["i_a_a", "i_b_a", "i_c_a"]];
/// Largest relative difference of two sampling periods.
const JITTER: f64 = 0.01;
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
/// Common-mode part of the three phases, relative to phase a, above which a remark mentions it.
const COMMON: f64 = 0.01;
/// Smallest relative change of the current that a doubled rotor time constant must cause. With less, errors of the
/// record of a few percent, such as harmonics and iron loss, exceed the information in the slip.
const TOLD: f64 = 0.1;
/// Share to which the residual must fall before the speed is taken for another quantity.
const NEARER: f64 = 0.3;

words! {
    /// Kinds of the voltages in a record.
    pub enum Voltages {
        /// Voltages that a drive commands: held over a row, reduced by the inverter voltage error.
        Commanded = "commanded",
        /// Samples at the terminals, at the instants of the currents, joined by straight lines.
        Sampled = "sampled",
        /// Means at the terminals from one row to the next.
        Mean = "mean",
    }
}

/// The way in which a file is read.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Other names of columns, each `OURS=THEIRS`.
    pub columns: Vec<String>,
    /// The kind of its voltages.
    pub voltages: Voltages,
    /// Number of rows after the currents of a row at which its voltage acts. Unset: 0 for a voltage at the terminals;
    /// for a commanded voltage, 1 and the delay of the current filter.
    pub delay: Option<f64>,
    /// Inverter voltage error, V. Unset: none for a voltage at the terminals, fitted for a commanded one.
    pub drop_v: Option<f64>,
    /// Times of the first and the last row, s; unset: all.
    pub times: [Option<f64>; 2],
}

/// Returns our names of columns, each with the name in the file.
fn renamed(mapping: &[String]) -> Result<Vec<(String, String)>, Error> {
    let known = [&[&[TIME, SPEED][..]], &VECTORS[..], &PHASES].concat().concat();
    let pair = |given: &String| {
        let Some((ours, theirs)) = given.split_once('=') else {
            let given = cut(given);
            return Err(Error::Refused(format!(
                "--column {given}: write OURS=THEIRS, for example --column speed_rpm=n"
            )));
        };
        if !known.contains(&ours) {
            let problem = unknown("column", ours, &known);
            return Err(Error::Refused(format!("--column {}: {problem}", cut(given))));
        }
        Ok((ours.to_owned(), theirs.to_owned()))
    };
    mapping.iter().map(pair).collect()
}

/// Reads a record; also returns remarks about its file.
pub(crate) fn read(
    path: &Path,
    reading: &Reading,
    config: &Config,
) -> Result<(Record, Vec<String>), Error> {
    let (renamed, columns) = (renamed(&reading.columns)?, Columns::read(path)?);
    let name = |ours: &'static str| {
        renamed.iter().find(|(known, _)| known == ours).map_or(ours, |(_, theirs)| theirs)
    };
    let (all, [from, to]) = (columns.need(name(TIME))?, reading.times);
    let first = from.map_or(0, |from| all.partition_point(|time| *time < from));
    let end = to.map_or(all.len(), |to| all.partition_point(|time| *time <= to)).max(first);
    let column = |ours| columns.need(name(ours)).map(|all| all[first..end].to_vec());
    if end - first < 100 {
        return Err(columns.error(format!("{} rows; at least 100 are needed", end - first)));
    }
    let time = column(TIME)?;
    let h = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let off = |row: &usize| h <= 0.0 || (time[*row] - time[row - 1] - h).abs() > JITTER * h;
    if let Some(row) = (1..time.len()).find(off) {
        let step = time[row] - time[row - 1];
        let problem = format!(
            "time_s is {step} s after the row before; the rows must be {h} s apart, within 1 %"
        );
        return Err(columns.at(first + row + 1, problem));
    }
    let has = |ours| columns.get(name(ours)).is_some();
    let are_phases = !has(VECTORS[0][0]) && has(PHASES[0][0]);
    let (mut remarks, measured) = (Vec::new(), reading.voltages != Voltages::Commanded);
    let mut vectors = |given: usize| -> Result<Vec<Complex>, Error> {
        if !are_phases {
            let [re, im] = [0, 1].map(|n| column(VECTORS[given][n]));
            return Ok(re?.into_iter().zip(im?).map(|(re, im)| Complex::new(re, im)).collect());
        }
        let [a, b, c] = [0, 1, 2].map(|n| column(PHASES[given][n]));
        let (a, b, third) = (a?, b?, c.is_ok());
        let c = c.unwrap_or_else(|_| a.iter().zip(&b).map(|(a, b)| -a - b).collect());
        let of = |k: usize| [a[k], b[k], c[k]];
        let sum: Vec<f64> = (0..a.len()).map(|k| of(k).iter().sum::<f64>() / 3.0).collect();
        let square = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>();
        let common = (square(&sum) / square(&a)).sqrt();
        let last = PHASES[given][2];
        if !third && measured {
            remarks.push(format!("No {last}: taken as −a −b; the three need not sum to zero."));
        } else if common > COMMON {
            remarks.push(format!(
                "{last} and the others have {:.1} % of phase a in common, which is ignored: a reference other than the star point, \
                 an offset, or another scale.",
                100.0 * common
            ));
        }
        Ok((0..a.len()).map(|k| clarke(of(k))).collect())
    };
    let (v, i) = (vectors(0)?, vectors(1)?);
    let age = 1.0 + f64::from(config.drive.current_age_s()) / h;
    let delay = reading.delay.unwrap_or(if measured { 0.0 } else { age });
    let to_rad_s = TAU / 60.0 * f64::from(config.motor.pole_pairs);
    // The mean of the row.
    let mut omega_m: Vec<f64> = column(SPEED)?.into_iter().map(|rpm| rpm * to_rad_s).collect();
    (1..omega_m.len()).for_each(|k| omega_m[k - 1] = 0.5 * (omega_m[k - 1] + omega_m[k]));
    let (v, sampled) = (delayed(&v, delay), reading.voltages == Voltages::Sampled);
    let v = if sampled { curved(&v) } else { v };
    Ok((Record { h, v, sampled, i, omega_m }, remarks))
}

/// Delays a signal by some samples, with straight lines between them; beyond its ends it has the first and the last value.
fn delayed(signal: &[Complex], samples: f64) -> Vec<Complex> {
    let at = |k: f64| signal[(k.max(0.0) as usize).min(signal.len() - 1)];
    let late =
        |k: f64| at(k.floor()) * (1.0 - k + k.floor()) + at(k.floor() + 1.0) * (k - k.floor());
    (0..signal.len()).map(|k| late(k as f64 - samples)).collect()
}

/// Returns samples whose straight connection has the integral of a smooth line through the given ones: otherwise a sine
/// of 40 samples would be 0.2 % too small.
fn curved(v: &[Complex]) -> Vec<Complex> {
    let mut curved = v.to_vec();
    (1..v.len() - 1).for_each(|k| curved[k] -= (v[k - 1] + v[k + 1] - v[k] * 2.0) / 12.0);
    curved
}

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
/// `i_beta_a` or `u_a_v`, `u_b_v`, `u_c_v`, `i_a_a`, `i_b_a`, `i_c_a`, of which phase c may be absent.
///
/// # Errors
/// [`Error::Data`] with the line; [`Error::Refused`] for a wrong mapping, and if the record does not determine the
/// motor, with the likely reason.
pub fn identify(path: &Path, reading: &Reading, config: &Config) -> Result<Outcome, Error> {
    let (record, mut remarks) = read(path, reading, config)?;
    let refused = |why: String| {
        let path = path.display();
        Error::Refused(format!("{path}: the record does not determine the motor: {why}"))
    };
    let expected = settings(config);
    // In electrical radians: an offset of the speed does not count as rotation.
    let speed = (record.omega_m.iter().map(|w| w * w).sum::<f64>() / record.i.len() as f64).sqrt();
    if speed * record.h * (record.i.len() as f64) < TAU {
        let why = "the shaft does not turn; a locked rotor shows neither L_s nor the time constant at small slip";
        return Err(refused(why.to_owned()));
    }
    let terminals = reading.voltages != Voltages::Commanded;
    let drop_v = reading.drop_v.or(terminals.then_some(0.0));
    let nearest = |record: &Record| nearest_machine(record, &expected, drop_v);
    let (current_a, fit) =
        (rms(&record.i), nearest(&record).map_err(|why| refused(why.to_string()))?);
    let Some(why) = fault(&fit, current_a) else {
        if drop_v.is_none() && fit.drop_v == 0.0 {
            remarks.push(BOUND.to_owned());
        }
        return Ok(outcome(&record, &fit, &expected, remarks, config));
    };
    let pairs = f64::from(config.motor.pole_pairs);
    let read_as = [
        (60.0 / TAU, "rad/s"),
        (60.0, "turns per second"),
        (1.0 / pairs, "electrical"),
        (-1.0, "of opposite sign"),
    ];
    let other = read_as.iter().find(|(factor, _)| {
        let omega_m = record.omega_m.iter().map(|w| w * factor).collect();
        let other = Record { omega_m, ..record.clone() };
        nearest(&other).is_ok_and(|it| it.residual_a < NEARER * fit.residual_a)
    });
    let hint = other.map(|(_, what)| format!("; the speed looks like {what}: then it fits"));
    Err(refused(why + &hint.unwrap_or_default()))
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
        "{} rows of {:.1} µs. ±: standard deviation between parts of the record; errors of the scale of voltage, current or speed are \
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
