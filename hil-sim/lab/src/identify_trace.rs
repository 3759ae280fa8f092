//! The motor from a recorded trace of a drive: voltages, currents and speed in a CSV file.

use std::f64::consts::TAU;
use std::path::Path;

use rayon::prelude::*;
use sim_bench::columns::Columns;
use sim_bench::error::nearest;
use sim_bench::prelude::*;

use crate::identification::output_error::{OutputErrorFit, Record};
use crate::identification::{Complex, Parameters};

/// A command of its own, for its options; not in the list of experiments.
pub const EXPERIMENT: Experiment = Experiment {
    name: "identify-trace",
    stands_for: "a recorded trace",
    about: "Parameters of the motor from a recorded trace: the machine whose current is nearest to the recorded one.",
    uses: &[&["motor.", "drive.motor.", "scales.current_delay_s"]],
    not: &[],
    run: |_| Err(Error::Refused("identify-trace is a command of its own".into())),
};

const TIME: &str = "time_s";
const SPEED: &str = "speed_rpm";
/// Voltages and currents as vectors, or of the phases a and b; the three phases sum to zero.
const VECTORS: [&str; 4] = ["u_alpha_v", "u_beta_v", "i_alpha_a", "i_beta_a"];
const PHASES: [&str; 4] = ["u_a_v", "u_b_v", "i_a_a", "i_b_a"];
/// Largest relative difference of two sampling periods.
const JITTER: f64 = 0.01;
/// Starts of the fit: factors of the resistance and of the inductances of the settings.
const STARTS: [f64; 3] = [1.0, 0.2, 5.0];

/// Names of the columns in the file, by ours.
struct Names(Vec<(String, String)>);

impl Names {
    fn new(mapping: &[String]) -> Result<Self, Error> {
        let known = [&[TIME, SPEED], &VECTORS[..], &PHASES].concat();
        let pair = |given: &String| {
            let Some((ours, theirs)) = given.split_once('=') else {
                return Err(Error::Refused(format!(
                    "--column {given}: write OURS=THEIRS, for example --column speed_rpm=n"
                )));
            };
            if !known.contains(&ours) {
                let guess = nearest(ours, known.iter().copied())
                    .map_or(String::new(), |name| format!("; did you mean `{name}`?"));
                let known = known.join(", ");
                return Err(Error::Refused(format!(
                    "--column {given}: there is no column `{ours}`{guess}; allowed: {known}"
                )));
            }
            Ok((ours.to_owned(), theirs.to_owned()))
        };
        Ok(Self(mapping.iter().map(pair).collect::<Result<_, _>>()?))
    }

    fn of<'a>(&'a self, ours: &'a str) -> &'a str {
        let mapped = self.0.iter().find(|(known, _)| known == ours);
        mapped.map_or(ours, |(_, theirs)| theirs)
    }
}

fn read(path: &Path, names: &Names, delay: Option<f64>, config: &Config) -> Result<Record, Error> {
    let columns = Columns::read(path)?;
    let column = |ours: &str| columns.need(names.of(ours));
    let time = column(TIME)?;
    if time.len() < 100 {
        return Err(columns.error(format!("{} rows; at least 100 are needed", time.len())));
    }
    let h = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let off = |row: &usize| (time[*row] - time[row - 1] - h).abs() > JITTER * h.abs();
    if h <= 0.0 || (1..time.len()).any(|row| off(&row)) {
        let row = (1..time.len()).find(off).unwrap_or(1);
        let step = time[row] - time[row - 1];
        return Err(columns.at(
            row + 1,
            format!(
                "time_s is {step} s after the row before; the rows must be {h} s apart, within 1 %"
            ),
        ));
    }
    let speed = column(SPEED)?;
    let are_phases =
        columns.get(names.of(VECTORS[0])).is_none() && columns.get(names.of(PHASES[0])).is_some();
    let given = if are_phases { PHASES } else { VECTORS };
    let [u0, u1, i0, i1] = given.map(column);
    let vectors = |first: Vec<f64>, second: Vec<f64>| -> Vec<Complex> {
        let vector = |(a, b): (f64, f64)| match are_phases {
            // Eq. 2.3 with a + b + c = 0.
            true => Complex::new(a, (a + 2.0 * b) / 3.0_f64.sqrt()),
            false => Complex::new(a, b),
        };
        first.into_iter().zip(second).map(vector).collect()
    };
    let (v, i) = (vectors(u0?, u1?), vectors(i0?, i1?));
    let delay = delay.unwrap_or(1.0 + f64::from(config.drive.scales.current_age_s()) / h);
    let to_rad_s = TAU / 60.0 * f64::from(config.motor.pole_pairs);
    let omega_m = speed.into_iter().map(|rpm| rpm * to_rad_s).collect();
    Ok(Record { h, v: delayed(&v, delay), i, omega_m })
}

/// A signal some samples later; the first value before its beginning.
fn delayed(signal: &[Complex], samples: f64) -> Vec<Complex> {
    let (whole, share) = (samples.floor() as usize, samples.fract());
    let at = |k: usize| signal[k.saturating_sub(whole)];
    (0..signal.len()).map(|k| at(k) * (1.0 - share) + at(k.saturating_sub(1)) * share).collect()
}

/// The machine of the settings, as the terminals show it.
fn settings(config: &Config) -> Parameters {
    let m = &config.motor;
    let (l_s, l_r) = (m.l_m + m.l_ls, m.l_m + m.l_lr);
    let sigma_l_s = l_s - m.l_m * m.l_m / l_r;
    Parameters { r_s: m.r_s, tau_r: l_r / m.r_r, sigma_l_s, l_s, omega_m: 0.0 }
}

/// Identifies the motor from a CSV file with the columns `time_s`, `speed_rpm`, and `u_alpha_v`, `u_beta_v`, `i_alpha_a`,
/// `i_beta_a` or `u_a_v`, `u_b_v`, `i_a_a`, `i_b_a`; `mapping` names others, each `OURS=THEIRS`. A voltage acts `delay`
/// rows after the currents of its row; unset: one, as the drive records it, and the delay of its current filter.
///
/// # Errors
/// [`Error::Data`] with the line; [`Error::Refused`] for a wrong mapping, and when the record does not determine the
/// motor.
pub fn identify(
    path: &Path,
    mapping: &[String],
    delay: Option<f64>,
    config: &Config,
) -> Result<Outcome, Error> {
    let record = read(path, &Names::new(mapping)?, delay, config)?;
    let expected = settings(config);
    let fits: Vec<_> = STARTS
        .par_iter()
        .map(|factor| {
            let Parameters { r_s, tau_r, sigma_l_s, l_s, .. } = expected;
            let (r_s, sigma_l_s, l_s) = (r_s * factor, sigma_l_s * factor, l_s * factor);
            record.fit(&Parameters { r_s, tau_r, sigma_l_s, l_s, omega_m: 0.0 })
        })
        .collect();
    let reason = fits[0].as_ref().err().copied();
    let best = fits.into_iter().flatten().min_by(|a, b| a.residual_a.total_cmp(&b.residual_a));
    let Some(fit) = best else {
        let reason = reason.map_or(String::new(), |reason| reason.to_string());
        let path = path.display();
        return Err(Error::Refused(format!(
            "{path}: the trace does not determine the motor: {reason}"
        )));
    };
    Ok(outcome(&record, &fit, &expected, config))
}

fn outcome(
    record: &Record,
    fit: &OutputErrorFit,
    expected: &Parameters,
    config: &Config,
) -> Outcome {
    let mut outcome = Outcome::default();
    let p = &fit.parameters;
    let rows = [
        ("stator resistance r_s", "r_s", "ohm", p.r_s, expected.r_s, 1.0),
        ("rotor time constant τ_r", "tau_r", "s", p.tau_r, expected.tau_r, 1.0),
        ("transient inductance σL_s", "sigma_l_s", "mH", p.sigma_l_s, expected.sigma_l_s, 1e3),
        ("stator inductance L_s", "l_s", "mH", p.l_s, expected.l_s, 1e3),
    ];
    let mut table = Table::new("Identified motor", &[]).note(format!(
        "{} rows of {:.1} µs. ±: standard deviation, for a white residual; a false voltage or current scale is not in it. \
         Settings: {}.",
        record.i.len(),
        1e6 * record.h,
        config.motor_text()
    ));
    for ((label, name, unit, found, set, scale), deviation) in rows.into_iter().zip(fit.deviations)
    {
        table.record([
            ("parameter", Cell::from(label)),
            ("unit", Cell::from(unit)),
            ("identified", Cell::significant(scale * found, 4)),
            ("±", Cell::significant(scale * deviation, 2)),
            ("settings", Cell::significant(scale * set, 4)),
            ("difference (%)", Cell::fixed(100.0 * (found / set - 1.0), 1)),
        ]);
        let unit = unit.to_lowercase();
        outcome.metrics.set(format!("{name}_{unit}"), scale * found);
        outcome.metrics.set(format!("{name}_deviation_{unit}"), scale * deviation);
    }
    outcome.metrics.set("drop_v", fit.drop_v);
    outcome.metrics.set("drop_deviation_v", fit.deviations[4]);
    outcome.metrics.set("residual_rms_a", fit.residual_a);
    outcome.tables.push(table);
    let line = |of: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        (0..record.i.len()).map(|k| (k as f64 * record.h, of(k))).collect()
    };
    let x = "time (s)";
    let difference = |k: usize| record.i[k] - fit.current[k];
    outcome.figures.push(
        Figure::new("trace", "Recorded current, and that of the identified motor", "")
            .panel(
                Panel::new(x, "current α (A)")
                    .with(Series::line("recorded", line(&|k| record.i[k].re)))
                    .with(Series::reference("identified motor", line(&|k| fit.current[k].re))),
            )
            .panel(
                Panel::new(x, "difference (A)")
                    .with(Series::line("α", line(&|k| difference(k).re)))
                    .with(Series::line("β", line(&|k| difference(k).im))),
            ),
    );
    outcome.remark(
        "The terminals determine four parameters. A T circuit with L_ls = L_lr has L_m = √(L_s (L_s − σL_s)), and \
         r_r = L_s/τ_r.",
    );
    outcome
}
