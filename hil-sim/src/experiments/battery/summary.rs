//! The verdict on many runs of the stress test.

use crate::experiments::course::Kind;
use crate::experiments::course::{CLASSES_PER_DEG, Trial, UNNOTICED_S};
use crate::prelude::*;

/// A duration in a run, s, and the number of a fault.
type Seconds = fn(&Trial) -> f64;
type Number = fn(&Trial) -> Option<u8>;

/// States that should not last: name in the metrics, head in the table, and duration, s.
const LASTING: [(&str, &str, Seconds); 3] = [
    ("wrong", "wrong (longest)", |trial| trial.wrong_s),
    ("beyond_45_deg", "beyond 45° (longest)", |trial| trial.lost_s),
    ("flux_off", "flux off (longest)", |trial| trial.flux_off_s),
];
/// Ends by a fault: metrics of all and of each fault, head in the table, and the number of the fault.
const ENDS: [(&str, &str, &str, Number); 2] = [
    ("trips", "trips_by_fault", "trips, fault: runs", |trial| trial.trip),
    ("refused_starts", "refused_by_fault", "refused, fault: runs", Trial::refused_by),
];

/// Runs that are judged together.
pub struct Summary<'a>(Vec<&'a Trial>);

impl<'a> Summary<'a> {
    /// Makes the summary of these runs.
    pub fn of(trials: impl IntoIterator<Item = &'a Trial>) -> Self {
        Self(trials.into_iter().collect())
    }

    /// Counts the runs with a property.
    pub fn count(&self, is: impl Fn(&Trial) -> bool) -> usize {
        self.0.iter().filter(|trial| is(trial)).count()
    }

    /// Angle error over all samples of all runs, degrees.
    pub fn error(&self) -> Stats {
        let mut error = Stats::default();
        self.0.iter().for_each(|trial| error.add(&trial.error));
        error
    }

    /// The magnitude that 99 % of all samples stay below, to 0.1°; not a number if there are no samples.
    pub fn p99_deg(&self) -> f64 {
        let mut histogram: BTreeMap<u32, u64> = BTreeMap::new();
        for &(class, count) in self.0.iter().flat_map(|trial| &trial.histogram) {
            *histogram.entry(class).or_default() += u64::from(count);
        }
        let (all, mut below) = (histogram.values().sum::<u64>(), 0);
        let reaches = |(_, count): &(&u32, &u64)| {
            below += **count;
            below as f64 >= 0.99 * all as f64
        };
        let class = histogram.iter().find(reaches);
        class.map_or(f64::NAN, |(class, _)| f64::from(class + 1) / CLASSES_PER_DEG)
    }

    /// The lowest limit of the q-axis current that a drive has learned, relative to the nominal limit.
    pub fn limit_share(&self) -> Option<f64> {
        self.0.iter().filter_map(|trial| trial.limit_share).reduce(f64::min)
    }

    /// Returns the number of runs by number of the fault.
    fn by_fault(&self, of: Number) -> BTreeMap<u8, usize> {
        let mut faults = BTreeMap::new();
        for fault in self.0.iter().filter_map(|trial| of(trial)) {
            *faults.entry(fault).or_default() += 1;
        }
        faults
    }

    /// Returns the number of runs in which a state lasted too long, and its longest duration, s.
    fn lasting(&self, of: Seconds) -> (usize, f64) {
        let longest = self.0.iter().map(|trial| of(trial)).fold(0.0, f64::max);
        (self.count(|trial| of(trial) > UNNOTICED_S), longest)
    }

    /// Writes the summary as metrics.
    pub fn metrics(&self, metrics: &mut Metrics) {
        let mut set = |name: &str, value: f64| metrics.set(name, value);
        let error = self.error();
        set("angle_error_rms_deg", error.rms());
        set("angle_error_p99_deg", self.p99_deg());
        set("angle_error_max_deg", error.largest());
        set("lost_runs", self.count(Trial::is_lost) as f64);
        for (name, _, of) in LASTING {
            let (runs, longest) = self.lasting(of);
            set(&format!("{name}_runs"), runs as f64);
            set(&format!("{name}_longest_s"), longest);
        }
        set("silent_runs", self.count(Trial::is_silent) as f64);
        set("stuck_runs", self.count(|trial| trial.stuck) as f64);
        set("sound_runs_stopped", self.count(|trial| trial.sound_stop) as f64);
        for (all, each, _, of) in ENDS {
            let faults = self.by_fault(of);
            set(all, faults.values().sum::<usize>() as f64);
            for (fault, count) in faults {
                set(&format!("{each}_{fault}"), count as f64);
            }
        }
        set("limited_runs", self.count(Trial::is_limited) as f64);
        if let Some(share) = self.limit_share() {
            set("limit_pct", 100.0 * share);
        }
        let torque = Stats::of(self.0.iter().filter_map(|trial| trial.torque_error));
        if torque.count() > 0 {
            set("torque_error_mean_pct", 100.0 * torque.mean());
            set("torque_error_deviation_pct", 100.0 * torque.deviation());
            set("torque_error_max_pct", 100.0 * torque.largest());
        }
        set("runs", self.0.len() as f64);
    }

    /// Returns the summary as cells of a row, with the heads of their columns.
    pub fn cells(&self) -> Vec<(&'static str, Cell)> {
        let error = self.error();
        let degrees = |value| Cell::fixed_or_dash((error.count() > 0).then_some(value), 2);
        let count = |is: fn(&Trial) -> bool| Cell::from(self.count(is).to_string());
        let lasting = LASTING.map(|(_, head, of)| match self.lasting(of) {
            (0, _) => (head, Cell::from("0")),
            (runs, longest) => (head, Cell::from(format!("{runs} ({longest:.2} s)"))),
        });
        let [trips, refused] = ENDS.map(|(_, _, head, of)| {
            let faults = self.by_fault(of);
            let each: Vec<_> = faults.iter().map(|(f, n)| format!("{f}: {n}")).collect();
            (head, Cell::from(if each.is_empty() { "0".to_owned() } else { each.join(", ") }))
        });
        let mut cells = vec![
            ("runs", Cell::from(self.0.len().to_string())),
            ("rms (°)", degrees(error.rms())),
            ("99 % (°)", degrees(self.p99_deg())),
            ("largest (°)", degrees(error.largest())),
            ("lost", count(Trial::is_lost)),
        ];
        cells.extend(lasting);
        cells.extend([("stuck", count(|trial| trial.stuck)), trips]);
        cells.extend([("sound", count(|trial| trial.sound_stop)), refused]);
        cells.push(("limited", count(Trial::is_limited)));
        cells
    }
}

/// Makes the table of the runs of each kind, and of all.
pub fn by_kind(trials: &[Trial]) -> Table {
    let mut kinds: Vec<Option<Kind>> = Vec::new();
    for trial in trials {
        if !kinds.contains(&trial.kind) {
            kinds.push(trial.kind);
        }
    }
    let row = |name, summary: Summary<'_>| {
        [("kind", Cell::from(name))].into_iter().chain(summary.cells())
    };
    let of_kind = |kind: Option<Kind>| {
        let some = Summary::of(trials.iter().filter(|trial| trial.kind == kind));
        row(kind.map(Kind::name).unwrap_or_default(), some)
    };
    let all = row("all".to_owned(), Summary::of(trials));
    Table::new("By kind", &[]).records(kinds.into_iter().map(of_kind).chain([all]))
}

/// Makes the table of the silent (undetected) runs, each with its disturbances in words.
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
    Table::of(texts::table("battery", "undetected"), &columns, silent)
}

/// Draws rms and largest error of every run, by its number.
pub fn figure(trials: &[Trial]) -> Figure {
    let points = |of: fn(&Trial) -> f64| {
        let regulated = (0..).zip(trials).filter(|(_, trial)| trial.error.count() > 0);
        regulated.map(|(number, trial)| (f64::from(number), of(trial))).collect()
    };
    let panel = Panel::new("number of the run", "angle error (°)")
        .with(Series::points("largest", points(|trial| trial.error.largest())))
        .with(Series::points("rms", points(|trial| trial.error.rms())));
    Figure::new("runs", "Angle error of every run", "").panel(panel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::course::Kind;

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

    /// Two runs with 1000 samples from 0.05° to 99.95° in steps of 0.1°: 990 are below 99.0°.
    #[test]
    fn the_percentile_is_over_all_samples_of_all_runs() {
        let errors: Vec<f64> = (0..1000).map(|n| (f64::from(n) + 0.5) * 0.1).collect();
        let (even, odd): (Vec<f64>, Vec<f64>) =
            errors.iter().partition(|e| ((*e * 10.0) as u32).is_multiple_of(2));
        let trials = [sound(&even), sound(&odd), Trial::unlearned(2, 25)];
        let summary = Summary::of(&trials);
        assert!((summary.p99_deg() - 99.0).abs() < 1e-9, "{}", summary.p99_deg());
        assert!((summary.error().rms() - Stats::of(errors).rms()).abs() < 1e-9);
        assert_eq!((summary.count(|_| true), summary.count(Trial::is_lost)), (3, 2));
        assert_eq!(summary.by_fault(Trial::refused_by), BTreeMap::from([(25, 1)]));
        assert!(Summary::of(&trials[2..]).p99_deg().is_nan());
    }
}
