//! The verdict over many runs of the battery.

use std::collections::BTreeMap;

use super::kind::Kind;
use super::trial::{CLASSES_PER_DEG, Trial};
use crate::prelude::*;

/// The meaning of the columns.
pub const REMARK: &str = "Error: while the drive regulates, from 0.5 s after the first reference on. Lost: beyond 45° at \
    any time from the start on. Wrong: beyond 30° for more than 0.5 s, interruptions up to 0.1 s included. Flux off: below half or above \
    twice that of the magnetising current for more than 0.5 s. Silent: wrong or flux off. Stuck: silent to the end of the \
    run. Trips: stopped by a fault while it regulates. Sound: trips with the angle within 30° and the flux within a factor \
    of two at all times before. Limited: the drive allows less torque current than the nominal limit. After the flux was \
    turned at once, wrong and flux off count from there, and the error no more.";

/// The verdict.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Angle error over all samples of all runs, degrees.
    pub error: Stats,
    /// The magnitude that 99 % of all samples stay below, to 0.1°; not a number without samples.
    pub p99_deg: f64,
    /// Runs.
    pub runs: usize,
    /// Lost runs.
    pub lost: usize,
    /// Runs wrong for long, and the longest time, s.
    pub wrong: (usize, f64),
    /// Runs beyond 45° for long, and the longest time, s.
    pub lost_for_long: (usize, f64),
    /// Runs with the flux off for long, and the longest time, s.
    pub flux_off: (usize, f64),
    /// Runs wrong or with the flux off for long, and those of them that were so to the end.
    pub silent: usize,
    /// See `silent`.
    pub stuck: usize,
    /// Runs stopped, by number of the fault.
    pub trips: BTreeMap<u8, usize>,
    /// Runs stopped although angle and flux were sound.
    pub sound_stops: usize,
    /// Runs with a drive that has learned a lower limit of the torque current.
    pub limited: usize,
    /// The least limit, in relation to the nominal one.
    pub limit_share: Option<f64>,
    /// Error of the torque of runs at constant torque, in relation to that at the nominal limit.
    pub torque_error: Stats,
    /// Starts refused, by number of the fault.
    pub refused: BTreeMap<u8, usize>,
}

impl Summary {
    /// That of these runs.
    pub fn of<'a>(trials: impl IntoIterator<Item = &'a Trial>) -> Self {
        let mut all = Self::default();
        let mut histogram: BTreeMap<u32, u64> = BTreeMap::new();
        for trial in trials {
            all.runs += 1;
            all.error.add(&trial.error);
            all.lost += usize::from(trial.is_lost());
            all.wrong.0 += usize::from(trial.is_wrong());
            all.wrong.1 = all.wrong.1.max(trial.wrong_s);
            all.lost_for_long.0 += usize::from(trial.is_lost_for_long());
            all.lost_for_long.1 = all.lost_for_long.1.max(trial.lost_s);
            all.flux_off.0 += usize::from(trial.is_flux_off());
            all.flux_off.1 = all.flux_off.1.max(trial.flux_off_s);
            all.silent += usize::from(trial.is_silent());
            all.stuck += usize::from(trial.stuck);
            all.sound_stops += usize::from(trial.sound_stop);
            all.limited += usize::from(trial.is_limited());
            all.limit_share = trial.limit_share.into_iter().chain(all.limit_share).reduce(f64::min);
            trial.torque_error.into_iter().for_each(|error| all.torque_error.push(error));
            trial.trip.into_iter().for_each(|fault| *all.trips.entry(fault).or_default() += 1);
            trial
                .refused_by()
                .into_iter()
                .for_each(|fault| *all.refused.entry(fault).or_default() += 1);
            for &(class, count) in &trial.histogram {
                *histogram.entry(class).or_default() += u64::from(count);
            }
        }
        all.p99_deg = quantile(&histogram, 0.99);
        all
    }

    /// As metrics.
    pub fn metrics(&self, metrics: &mut Metrics) {
        metrics.set("angle_error_rms_deg", self.error.rms());
        metrics.set("angle_error_p99_deg", self.p99_deg);
        metrics.set("angle_error_max_deg", self.error.largest());
        metrics.set("lost_runs", self.lost as f64);
        metrics.set("wrong_runs", self.wrong.0 as f64);
        metrics.set("wrong_longest_s", self.wrong.1);
        metrics.set("beyond_45_deg_runs", self.lost_for_long.0 as f64);
        metrics.set("beyond_45_deg_longest_s", self.lost_for_long.1);
        metrics.set("flux_off_runs", self.flux_off.0 as f64);
        metrics.set("flux_off_longest_s", self.flux_off.1);
        metrics.set("silent_runs", self.silent as f64);
        metrics.set("stuck_runs", self.stuck as f64);
        metrics.set("sound_runs_stopped", self.sound_stops as f64);
        metrics.set("trips", self.trips.values().sum::<usize>() as f64);
        for (fault, count) in &self.trips {
            metrics.set(format!("trips_by_fault_{fault}"), *count as f64);
        }
        metrics.set("refused_starts", self.refused.values().sum::<usize>() as f64);
        for (fault, count) in &self.refused {
            metrics.set(format!("refused_by_fault_{fault}"), *count as f64);
        }
        metrics.set("limited_runs", self.limited as f64);
        if let Some(share) = self.limit_share {
            metrics.set("limit_pct", 100.0 * share);
        }
        if self.torque_error.count() > 0 {
            let error = &self.torque_error;
            metrics.set("torque_error_mean_pct", 100.0 * error.mean());
            metrics.set("torque_error_deviation_pct", 100.0 * error.deviation());
            metrics.set("torque_error_max_pct", 100.0 * error.largest());
        }
        metrics.set("runs", self.runs as f64);
    }

    /// As cells of a row, with the heads of their columns.
    pub fn cells(&self) -> Vec<(&'static str, Cell)> {
        let regulated = self.error.count() > 0;
        let degrees = |value| Cell::or_dash(regulated.then(|| Cell::fixed(value, 2)));
        vec![
            ("runs", Cell::from(self.runs.to_string())),
            ("rms (°)", degrees(self.error.rms())),
            ("99 % (°)", degrees(self.p99_deg)),
            ("largest (°)", degrees(self.error.largest())),
            ("lost", Cell::from(self.lost.to_string())),
            ("wrong (longest)", Cell::from(lasting(self.wrong))),
            ("beyond 45° (longest)", Cell::from(lasting(self.lost_for_long))),
            ("flux off (longest)", Cell::from(lasting(self.flux_off))),
            ("stuck", Cell::from(self.stuck.to_string())),
            ("trips, fault: runs", Cell::from(by_fault(&self.trips))),
            ("sound", Cell::from(self.sound_stops.to_string())),
            ("refused, fault: runs", Cell::from(by_fault(&self.refused))),
            ("limited", Cell::from(self.limited.to_string())),
        ]
    }
}

fn lasting((runs, longest): (usize, f64)) -> String {
    if runs == 0 { "0".to_owned() } else { format!("{runs} ({longest:.2} s)") }
}

fn by_fault(faults: &BTreeMap<u8, usize>) -> String {
    match faults.is_empty() {
        true => "0".to_owned(),
        false => faults.iter().map(|(f, n)| format!("{f}: {n}")).collect::<Vec<_>>().join(", "),
    }
}

/// The upper end of the class below which this share of all values is.
fn quantile(histogram: &BTreeMap<u32, u64>, share: f64) -> f64 {
    let all: u64 = histogram.values().sum();
    let mut below = 0;
    for (&class, count) in histogram {
        below += count;
        if below as f64 >= share * all as f64 {
            return f64::from(class + 1) / CLASSES_PER_DEG;
        }
    }
    f64::NAN
}

/// The runs of each kind.
pub fn by_kind(trials: &[Trial]) -> Table {
    let mut table = Table::new("By kind", &[]);
    let mut kinds: Vec<Option<Kind>> = Vec::new();
    for trial in trials {
        if !kinds.contains(&trial.kind) {
            kinds.push(trial.kind);
        }
    }
    for kind in kinds {
        let cells = Summary::of(trials.iter().filter(|trial| trial.kind == kind)).cells();
        table.record(
            [("kind", Cell::from(kind.map(Kind::name).unwrap_or_default()))]
                .into_iter()
                .chain(cells),
        );
    }
    let all = Summary::of(trials).cells();
    table.record([("kind", Cell::from("all"))].into_iter().chain(all));
    table
}

/// The silent runs, each with its disturbances in words.
pub fn silent(trials: &[Trial], disturbances: impl Fn(usize) -> String) -> Table {
    let (disturbances, end) = (&disturbances, |trial: &Trial| match trial.trip {
        Some(fault) => format!("fault {fault}"),
        None if trial.stuck => "stuck".to_owned(),
        None => "sound".to_owned(),
    });
    let columns = columns![|number, trial: &Trial|
        "run" => Cell::from(number.to_string());
        "seed" => Cell::from(trial.seed.to_string());
        "kind" => Cell::from(trial.kind.map(Kind::name).unwrap_or_default());
        "wrong (s)" => Cell::fixed(trial.wrong_s, 2);
        "flux off (s)" => Cell::fixed(trial.flux_off_s, 2);
        "end" => Cell::from(end(trial));
        "disturbances" => Cell::from(disturbances(number));
    ];
    let silent = trials.iter().enumerate().filter(|(_, trial)| trial.is_silent());
    Table::of("Silently wrong", &columns, silent)
        .note("Disturbances: of the page Statistics, in relation to their full sizes.")
}

/// Rms and largest error of every run, by its number.
pub fn figure(trials: &[Trial]) -> Figure {
    let points = |of: fn(&Trial) -> f64| {
        let regulated = (0..).zip(trials).filter(|(_, trial)| trial.error.count() > 0);
        regulated.map(|(number, trial)| (f64::from(number), of(trial))).collect()
    };
    Figure::new("runs", "Angle error of every run", "").panel(
        Panel::new("number of the run", "angle error (°)")
            .with(Series::points("largest", points(|trial| trial.error.largest())))
            .with(Series::points("rms", points(|trial| trial.error.rms()))),
    )
}

#[cfg(test)]
mod tests {
    use super::super::kind::Kind;
    use super::*;

    fn sound(errors: &[f64]) -> Trial {
        let mut trial = Trial { kind: Some(Kind::Steps), ..Trial::default() };
        trial.error = Stats::of(errors.iter().copied());
        let mut counts: BTreeMap<u32, u32> = BTreeMap::new();
        errors
            .iter()
            .for_each(|e| *counts.entry((e.abs() * CLASSES_PER_DEG) as u32).or_default() += 1);
        trial.histogram = counts.into_iter().collect();
        trial.largest_deg = trial.error.largest();
        trial
    }

    /// 1000 samples from 0.05° to 99.95° in steps of 0.1°, in two runs: 990 are below 99.0°.
    #[test]
    fn the_percentile_is_over_all_samples_of_all_runs() {
        let errors: Vec<f64> = (0..1000).map(|n| (f64::from(n) + 0.5) * 0.1).collect();
        let (even, odd): (Vec<f64>, Vec<f64>) =
            errors.iter().partition(|e| ((*e * 10.0) as u32).is_multiple_of(2));
        let trials = [sound(&even), sound(&odd), Trial::unlearned(2, 25)];
        let summary = Summary::of(&trials);
        assert!((summary.p99_deg - 99.0).abs() < 1e-9, "{}", summary.p99_deg);
        assert!((summary.error.rms() - Stats::of(errors).rms()).abs() < 1e-9);
        assert_eq!((summary.runs, summary.lost), (3, 2));
        assert_eq!(summary.refused, BTreeMap::from([(25, 1)]));
        assert!(Summary::of(&trials[2..]).p99_deg.is_nan());
    }
}
