//! Trials of the lock monitor: loss of lock, wrong locks, and false alarms.

mod trials;

pub use self::trials::Trial;
use self::trials::{HealthyKind, OVER_SPEED_S};
use crate::prelude::*;
use crate::stats::upper_bound_95;

/// Number of trials of each forced offset; ten times as many runs are checked for false alarms.
const RUNS: u32 = 100;
const HEALTHY_PER_RUN: usize = 10;
/// Forced offsets, degrees, and their names in the metrics.
const OFFSETS: [(f64, &str); 5] =
    [(90.0, "p90"), (-90.0, "m90"), (120.0, "p120"), (-120.0, "m120"), (180.0, "180")];
/// Speeds of the forced offsets, rpm.
const SPEED_RPM: f64 = 300.0;
/// Permitted error of the speed estimate, rpm: 5° of angle error cause this slip at 3 A.
const ESTIMATE_RPM: f64 = 50.0;
/// Speeds of the starts, rpm: above the highest the flux does not reach 10 % of its magnitude.
const START_RPM: [f64; 11] = [0.0, 5.0, -5.0, 15.0, -15.0, 30.0, -50.0, 80.0, 150.0, -150.0, 300.0];

/// The trials, in this order: all trials of each forced offset, the healthy runs, over-speed, and at each speed of
/// [`START_RPM`] the starts and then the relocks.
pub struct LockMonitor {
    config: Config,
    seed: u64,
    runs: usize,
}

impl Study for LockMonitor {
    type Record = Trial;
    const NAME: &'static str = "lock-monitor";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let config = context.config.clone();
        let runs = config.extent.runs.unwrap_or(RUNS) as usize;
        let all = Self { config, seed: context.seed, runs };
        let starts = 2 * START_RPM.len() * all.starts_each();
        let runs = OFFSETS.len() * runs + all.healthy_runs() + runs + starts;
        Ok((all, runs))
    }

    fn run(&self, number: usize) -> Result<Trial, Error> {
        // Each part has its own seeds.
        let seed = |part: usize, n| seed_of(self.seed, n).wrapping_add((part as u64) << 40);
        let mut n = number;
        if n < OFFSETS.len() * self.runs {
            let (offset, n) = (n / self.runs, n % self.runs);
            let case = trials::case(seed(offset, n), SPEED_RPM);
            let mut trial = trials::forced(&self.config, case, OFFSETS[offset].0)?;
            if n > 0 {
                // The figure shows only the first trial.
                trial.loss.clear();
            }
            return Ok(trial);
        }
        n -= OFFSETS.len() * self.runs;
        if n < self.healthy_runs() {
            let kind = HealthyKind::VALUES[n % HealthyKind::VALUES.len()];
            return trials::healthy(&self.config, seed(10, n), kind);
        }
        n -= self.healthy_runs();
        if n < self.runs {
            let limit = self.over_speed_limit();
            return trials::over_speed(&self.config, seed(11, n), limit);
        }
        n -= self.runs;
        let (group, n) = (n / self.starts_each(), n % self.starts_each());
        let (rpm, relock) = (START_RPM[group / 2], group % 2 == 1);
        trials::start(&self.config, rpm, seed(20 + group, n), relock)
    }

    fn outcome(&self, _: &Context<'_>, records: Vec<Trial>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        let (forced, rest) = records.split_at(OFFSETS.len() * self.runs);
        let (healthy, rest) = rest.split_at(self.healthy_runs());
        let (over_speed, starts) = rest.split_at(self.runs);
        self.forced(forced, &mut outcome);
        self.healthy(healthy, &mut outcome);
        self.over_speed(over_speed, &mut outcome);
        self.starts(starts, &mut outcome);
        outcome.metrics.set("runs", self.runs as f64);
        outcome.remarks = assumptions(&self.config);
        texts::add_remarks(&mut outcome, "lock-monitor", &[("speed_rpm", SPEED_RPM)]);
        Ok(outcome)
    }
}

impl LockMonitor {
    /// Number of starts, and of relocks, at each speed.
    fn starts_each(&self) -> usize {
        self.runs.div_ceil(5)
    }

    fn healthy_runs(&self) -> usize {
        HEALTHY_PER_RUN * self.runs
    }

    /// Speed of the over-speed trials, rpm.
    fn over_speed_limit(&self) -> f64 {
        f64::from(self.config.drive.highest_rpm()) + ESTIMATE_RPM
    }

    /// The columns of all trials; each table uses some of them.
    fn columns(&self) -> Vec<Column<'_, Trial>> {
        let fault = |r: &Trial| r.fault.map(|fault| fault.to_string()).unwrap_or_default();
        columns![|n, r: &Trial|
            "forced by (°)" => Cell::or_dash(OFFSETS.get(n / self.runs).map(|o| Cell::fixed(o.0, 0)));
            "seed" => Cell::from(r.case.seed.to_string());
            "kind" => Cell::from(r.kind.map_or("", Words::word));
            "iq (A)" => Cell::fixed(r.case.iq, 3);
            "speed (rpm)" => Cell::fixed(r.case.rpm, 1);
            "wrong for (s)" => Cell::fixed(r.wrong_s, 3);
            "fault" => Cell::from(fault(r));
            "rpm/s" => Cell::fixed(r.rpm_per_s, 0);
        ]
    }

    /// Makes a table of the failed trials of a part, with these columns; none if there are no such trials.
    fn listed(&self, title: &str, heads: &[&str], of: Vec<(usize, &Trial)>) -> Option<Table> {
        let mut columns = self.columns();
        columns.retain(|column| heads.contains(&column.head));
        (!of.is_empty()).then(|| Table::of(title, &columns, of))
    }

    fn forced(&self, all: &[Trial], outcome: &mut Outcome) {
        let parts: Vec<_> = OFFSETS.into_iter().zip(all.chunks(self.runs)).collect();
        let wrong = |trials: &[Trial], share: f64| {
            quantile(&sorted(trials.iter().map(|t| t.wrong_s)), share)
        };
        let stopped = |trials: &[Trial]| trials.iter().filter(|t| t.fault.is_some()).count();
        let missed = |trials: &[Trial]| trials.iter().filter(|t| !t.is_in_time()).count();
        let count = |n: usize| Cell::fixed(n as f64, 0);
        let columns = columns![|_, ((degrees, _), trials): &((f64, &str), &[Trial])|
            "forced by (°)" => Cell::fixed(*degrees, 0);
            "trials" => count(trials.len());
            "stopped" => count(stopped(trials));
            "recovered" => count(trials.len() - stopped(trials));
            "median (s)" => Cell::fixed(wrong(trials, 0.5), 3);
            "99 % (s)" => Cell::fixed(wrong(trials, 0.99), 3);
            "longest (s)" => Cell::fixed(wrong(trials, 1.0), 3);
            "not in time" => count(missed(trials));
        ];
        let table = texts::table("lock-monitor", "forced");
        outcome.tables.push(Table::of(table, &columns, parts.iter().enumerate()));
        let late = all.iter().enumerate().filter(|(_, t)| !t.is_in_time()).collect();
        let heads = ["forced by (°)", "seed", "iq (A)", "speed (rpm)", "wrong for (s)"];
        outcome.tables.extend(self.listed("Not in time", &heads, late));
        let mut times = Panel::new("quadrature current (A)", "time at a wrong angle (s)");
        let mut losses = Panel::new("time after the angle was forced off (s)", "saliency loss");
        for ((degrees, name), trials) in parts {
            let m = &mut outcome.metrics;
            m.set(format!("not_in_time_{name}"), missed(trials) as f64);
            m.set(format!("stopped_{name}"), stopped(trials) as f64);
            m.set(format!("wrong_longest_{name}_s"), wrong(trials, 1.0));
            let label = format!("{degrees}°");
            let points = trials.iter().map(|t| (t.case.iq, t.wrong_s)).collect();
            times = times.with(Series::points(label.clone(), points));
            losses = losses.with(Series::line(label, trials[0].loss.clone()));
        }
        let figure = Figure::new("forced", "Angle forced off", "").panel(times).panel(losses);
        outcome.figures.push(figure);
    }

    fn healthy(&self, runs: &[Trial], outcome: &mut Outcome) {
        let alarms: Vec<_> = runs.iter().enumerate().filter(|(_, r)| r.fault.is_some()).collect();
        let largest = |of: fn(&Trial) -> f64| runs.iter().map(of).fold(0.0, f64::max);
        let (largest_loss, bound) =
            (largest(|r| r.largest_loss), upper_bound_95(alarms.len() as u64, runs.len() as u64));
        let m = &mut outcome.metrics;
        m.set("false_alarms", alarms.len() as f64);
        m.set("false_alarm_runs", runs.len() as f64);
        m.set("false_alarm_rate_95", bound);
        m.set("healthy_loss_max", largest_loss);
        m.set("healthy_error_max_deg", largest(|r| r.largest_deg));
        let row = [
            ("runs", Cell::fixed(runs.len() as f64, 0)),
            ("false alarms", Cell::fixed(alarms.len() as f64, 0)),
            ("rate per run, 95 % bound", Cell::significant(bound, 2)),
            ("largest loss seen", Cell::fixed(largest_loss, 2)),
        ];
        outcome.tables.push(texts::table("lock-monitor", "false_alarms").records([row]));
        let heads = ["seed", "kind", "iq (A)", "speed (rpm)", "fault"];
        outcome.tables.extend(self.listed("Every false alarm", &heads, alarms));
        let mut panel = Panel::new("quadrature current (A)", "largest saliency loss in the run");
        for &kind in HealthyKind::VALUES {
            let of_kind = runs.iter().filter(|r| r.kind == Some(kind));
            let points = of_kind.map(|r| (r.case.iq, r.largest_loss)).collect();
            panel = panel.with(Series::points(kind.word(), points));
        }
        outcome.figures.push(Figure::new("healthy", "Runs without a lost lock", "").panel(panel));
    }

    fn over_speed(&self, trials: &[Trial], outcome: &mut Outcome) {
        let limit = self.over_speed_limit();
        let is_late = |t: &Trial| t.fault.is_none() || t.late_s > OVER_SPEED_S;
        let late: Vec<_> = trials.iter().enumerate().filter(|(_, t)| is_late(t)).collect();
        let latest = trials.iter().map(|t| t.late_s).fold(0.0, f64::max);
        let before = trials.iter().filter(|t| t.late_s <= 0.0).count();
        outcome.metrics.set("over_speed_late", late.len() as f64);
        outcome.metrics.set("over_speed_latest_s", latest);
        let row = [
            ("limit (rpm)", Cell::fixed(limit, 0)),
            ("trials", Cell::fixed(trials.len() as f64, 0)),
            ("off before the limit", Cell::fixed(before as f64, 0)),
            ("latest after it (s)", Cell::fixed(latest, 3)),
            ("not in time", Cell::fixed(late.len() as f64, 0)),
        ];
        outcome.tables.push(texts::table("lock-monitor", "over_speed").records([row]));
        let heads = ["seed", "iq (A)", "rpm/s"];
        outcome.tables.extend(self.listed("Over-speed not in time", &heads, late));
    }

    fn starts(&self, all: &[Trial], outcome: &mut Outcome) {
        let each = self.starts_each();
        let parts: Vec<_> = START_RPM.into_iter().zip(all.chunks(2 * each)).collect();
        let count = |trials: &[Trial], is: fn(&Trial) -> bool| {
            trials.iter().filter(|trial| is(trial)).count() as f64
        };
        let columns = columns![|_, (rpm, trials): &(f64, &[Trial])|
            "speed (rpm)" => Cell::fixed(*rpm, 0);
            "of each" => Cell::fixed(each as f64, 0);
            "starts" => Cell::fixed(count(&trials[..each], |s| s.accepted), 0);
            "relocks" => Cell::fixed(count(&trials[each..], |s| s.accepted), 0);
            "accepted at a wrong angle" => Cell::fixed(count(trials, |s| !s.is_honest()), 0);
        ];
        let title = "Accepted flying starts and relocks";
        outcome.tables.push(Table::of(title, &columns, parts.iter().enumerate()));
        let at_rest = |s: &Trial| s.case.rpm == 0.0 && !s.accepted;
        outcome.metrics.set("refused_at_rest", count(all, at_rest));
        outcome.metrics.set("wrong_starts", count(all, |s| !s.is_honest()));
    }
}
