//! Reads a record of a motor from a CSV file.

use std::ops::Range;
use std::path::Path;

use drive_settings::words;
use sim_bench::columns::Columns;
use sim_bench::error::{cut, unknown};
use sim_bench::plant::clarke;

use crate::identification::Complex;
use crate::identification::output_error::Record;
use crate::prelude::*;

const TIME: &str = "time_s";
const SPEED: &str = "speed_rpm";
/// Columns of voltages and currents, as vectors, per phase, or from line to line. The third channel may be absent.
const VECTORS: [&[&str]; 2] = [&["u_alpha_v", "u_beta_v"], &["i_alpha_a", "i_beta_a"]];
const PHASES: [&[&str]; 2] = [&["u_a_v", "u_b_v", "u_c_v"], &["i_a_a", "i_b_a", "i_c_a"]];
const LINES: &[&str] = &["u_ab_v", "u_bc_v", "u_ca_v"];
/// Quotient of the vectors of line-to-line and phase voltages: √3 at 30°.
pub(crate) const LINE_TO_PHASE: Complex = Complex::new(1.5, 0.866_025_403_784_438_6);
/// Largest relative difference of two sampling periods.
const JITTER: f64 = 0.01;
/// Common-mode part of the three phases, relative to phase a, above which a remark mentions it.
const COMMON: f64 = 0.01;
/// Share of the largest usual speed by which a row must differ from its neighbours to be an outlier.
const OUTLIER: f64 = 0.5;

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
    /// Time between two channels that are sampled one after another, in the order of the columns, s. Unset: not known.
    pub skew_s: Option<f64>,
}

impl Reading {
    /// Returns the reading of a whole file with these voltages and our names of columns.
    pub fn of(voltages: Voltages) -> Self {
        let (columns, times) = (Vec::new(), [None; 2]);
        Self { columns, voltages, delay: None, drop_v: None, times, skew_s: None }
    }
}

/// Contents of a file.
pub(crate) struct Contents {
    pub(crate) record: Record,
    /// Remarks about the file.
    pub(crate) remarks: Vec<String>,
    /// Number of channels that may have been sampled one after another; 0 if they were not or the skew is given.
    pub(super) channels: usize,
}

/// Returns our names of columns, each with the name in the file.
fn renamed(mapping: &[String]) -> Result<Vec<(String, String)>, Error> {
    let known = [&[&[TIME, SPEED], LINES][..], &VECTORS, &PHASES].concat().concat();
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

/// Checks that no row of the speed differs from those beside it by more than a shaft can change.
fn check_outliers(rpm: &[f64], columns: &Columns, first: usize) -> Result<(), Error> {
    let usual: Vec<f64> = (0..rpm.len())
        .map(|k| {
            let mut around = rpm[k.saturating_sub(2)..(k + 3).min(rpm.len())].to_vec();
            around.sort_by(f64::total_cmp);
            around[around.len() / 2]
        })
        .collect();
    let largest = usual.iter().fold(0.0_f64, |largest, rpm| largest.max(rpm.abs()));
    let is_outlier = |k: &usize| (rpm[*k] - usual[*k]).abs() > OUTLIER * largest;
    let Some(k) = (0..rpm.len()).find(is_outlier) else { return Ok(()) };
    let (speed, usual) = (rpm[k], usual[k]);
    let problem = format!(
        "speed_rpm = {speed} is an outlier, the rows around it have {usual}; replace such rows by the mean of their neighbours"
    );
    Err(columns.at(first + k + 1, problem))
}

/// Rows and columns of a file, under our names.
struct Rows {
    columns: Columns,
    renamed: Vec<(String, String)>,
    chosen: Range<usize>,
}

impl Rows {
    fn place(&self, ours: &str) -> Option<usize> {
        self.columns.place(self.name(ours))
    }

    fn name<'a>(&'a self, ours: &'a str) -> &'a str {
        self.renamed.iter().find(|(known, _)| known == ours).map_or(ours, |(_, theirs)| theirs)
    }

    fn column(&self, ours: &str) -> Result<Vec<f64>, Error> {
        self.columns.need(self.name(ours)).map(|all| all[self.chosen.clone()].to_vec())
    }

    /// Returns the columns of the voltages (0) or the currents (1).
    fn form(&self, quantity: usize) -> Result<&'static [&'static str], Error> {
        let forms = [VECTORS[quantity], PHASES[quantity], LINES];
        let forms = &forms[..forms.len() - quantity];
        let names = || forms.iter().map(|form| form[0]).collect::<Vec<_>>().join(" or ");
        let form = forms.iter().find(|form| self.place(form[0]).is_some());
        form.copied().ok_or_else(|| self.columns.missing(&names()))
    }

    /// Returns vectors from columns, each sampled `late` rows after the time of its row; `measured` says whether the
    /// phases may have a common-mode part.
    fn vectors(
        &self,
        form: &[&str],
        late: &dyn Fn(&str) -> f64,
        measured: bool,
        remarks: &mut Vec<String>,
    ) -> Result<Vec<Complex>, Error> {
        let channel = |name: &str| self.column(name).map(|samples| on_time(&samples, late(name)));
        let (a, b) = (channel(form[0])?, channel(form[1])?);
        let &[first, _, last] = form else {
            return Ok(a.into_iter().zip(b).map(|(re, im)| Complex::new(re, im)).collect());
        };
        let (third, are_lines) = (self.place(last).is_some(), form == LINES);
        let c = match third {
            true => channel(last)?,
            false => a.iter().zip(&b).map(|(a, b)| -a - b).collect(),
        };
        let of = |k: usize| [a[k], b[k], c[k]];
        let sum: Vec<f64> = (0..a.len()).map(|k| of(k).iter().sum::<f64>() / 3.0).collect();
        let square = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>();
        let common = (square(&sum) / square(&a)).sqrt();
        if !third && measured && !are_lines {
            remarks.push(format!("No {last}: taken as −a −b; the three need not sum to zero."));
        } else if common > COMMON {
            remarks.push(format!(
                "{last} and the others have {:.1} % of {first} in common, which is ignored: {}an offset, or another scale.",
                100.0 * common,
                if are_lines { "" } else { "a reference other than the star point, " }
            ));
        }
        let divisor = if are_lines { LINE_TO_PHASE } else { Complex::ONE };
        Ok((0..a.len()).map(|k| clarke(of(k)) / divisor).collect())
    }
}

/// Reads a record.
pub(crate) fn read(path: &Path, reading: &Reading, config: &Config) -> Result<Contents, Error> {
    let (renamed, columns) = (renamed(&reading.columns)?, Columns::read(path)?);
    let mut rows = Rows { chosen: 0..columns.len(), columns, renamed };
    let (all, [from, to]) = (rows.column(TIME)?, reading.times);
    let first = from.map_or(0, |from| all.partition_point(|time| *time < from));
    let end = to.map_or(all.len(), |to| all.partition_point(|time| *time <= to)).max(first);
    rows.chosen = first..end;
    if end - first < 100 {
        return Err(rows.columns.error(format!("{} rows; at least 100 are needed", end - first)));
    }
    let time = rows.column(TIME)?;
    let h = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let off = |row: &usize| h <= 0.0 || (time[*row] - time[row - 1] - h).abs() > JITTER * h;
    if let Some(row) = (1..time.len()).find(off) {
        let step = time[row] - time[row - 1];
        let problem = format!(
            "time_s is {step} s after the row before; the rows must be {h} s apart, within 1 %"
        );
        return Err(rows.columns.at(first + row + 1, problem));
    }
    let (measured, sampled) =
        (reading.voltages != Voltages::Commanded, reading.voltages == Voltages::Sampled);
    let forms = [rows.form(0)?, rows.form(1)?];
    let mut places: Vec<usize> =
        forms.concat().iter().filter_map(|ours| rows.place(ours)).collect();
    places.sort_unstable();
    let is_sequence = sampled && forms.iter().all(|form| form.len() == 3);
    let channels = if is_sequence { places.len() } else { 0 };
    check_skew(reading.skew_s, channels, h)?;
    let skew = reading.skew_s.unwrap_or(0.0) / h;
    let late = |ours: &str| {
        let before =
            places.iter().filter(|place| rows.place(ours).is_some_and(|own| **place < own));
        skew * before.count() as f64
    };
    let mut remarks = Vec::new();
    let [v, i] = forms.map(|form| rows.vectors(form, &late, measured, &mut remarks));
    let (v, i, rpm) = (v?, i?, rows.column(SPEED)?);
    check_outliers(&rpm, &rows.columns, first)?;
    let age = 1.0 + f64::from(config.drive.current_age_s()) / h;
    let delay = reading.delay.unwrap_or(if measured { 0.0 } else { age });
    let to_rad_s = TAU / 60.0 * f64::from(config.motor.pole_pairs);
    // The mean of the row.
    let mut omega_m: Vec<f64> = rpm.into_iter().map(|rpm| rpm * to_rad_s).collect();
    (1..omega_m.len()).for_each(|k| omega_m[k - 1] = 0.5 * (omega_m[k - 1] + omega_m[k]));
    let v = delayed(&v, delay);
    let v = if sampled { curved(&v) } else { v };
    let channels = if reading.skew_s.is_none() { channels } else { 0 };
    Ok(Contents { record: Record { h, v, sampled, i, omega_m }, remarks, channels })
}

/// Checks a given skew against the number of channels that are sampled one after another, and the sampling period.
fn check_skew(skew_s: Option<f64>, channels: usize, h: f64) -> Result<(), Error> {
    let Some(skew_us) = skew_s.map(|skew_s| 1e6 * skew_s) else { return Ok(()) };
    let (scan_us, h_us) = (skew_us * channels.saturating_sub(1) as f64, 1e6 * h);
    let problem = match channels {
        0 => {
            "it needs --voltages sampled, and voltages and currents per phase or from line to line"
                .to_owned()
        }
        _ if scan_us >= h_us => format!(
            "with {channels} channels the last sample would be {scan_us:.0} µs after the first, and the rows are {h_us:.0} µs apart"
        ),
        _ => return Ok(()),
    };
    Err(Error::Refused(format!("--skew {skew_us:.2}: {problem}")))
}

/// Returns a channel at the times of the rows, from samples that were taken `late` rows after them: on a parabola
/// through three samples.
fn on_time(samples: &[f64], late: f64) -> Vec<f64> {
    let at = |k: usize| samples[k.min(samples.len() - 1)];
    let moved = |k: usize| {
        let (before, here, after) = (at(k.saturating_sub(1)), at(k), at(k + 1));
        here - 0.5 * late * (after - before) + 0.5 * late * late * (after - 2.0 * here + before)
    };
    (0..samples.len()).map(moved).collect()
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
