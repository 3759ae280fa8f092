//! The commissioning: one session on the motor of the configuration, or statistics over machines drawn around it.

mod machine;
pub mod refusals;
mod session;

use drive_core::commission::{Commissioning, Step};
use serde::{Deserialize, Serialize};

use super::statistics::{Study, whole};
use super::{BENCH, Context, DRIVE, Experiment};
use crate::config::Config;
use crate::error::Error;
use crate::outcome::{Cell, Outcome, Table};
use crate::rig::Rig;
use crate::stats::exact;
use machine::{Circuit, drawn};
use session::{Abort, Session, unaware};

/// Not in the source, which asks for it as future work.
pub const EXPERIMENT: Experiment = Experiment {
    name: "commission",
    stands_for: "beyond the dissertation",
    about: "From the nameplate to the parameters of the motor, at standstill; `--set runs=N` for random machines and boards.",
    uses: &[BENCH, DRIVE, &["load.", "spread.machine", "runs"]],
    not: &[],
    run: whole::<Commission>,
};

/// Largest error of an accepted machine that counts as right: linear plant.
const RIGHT_PCT: f64 = 3.0;
/// Machines in the table, the worst first.
const LISTED: usize = 20;

/// The sessions.
pub struct Commission {
    config: Config,
    seed: u64,
    machines: Option<usize>,
}

/// A session of the statistics.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// Why it was refused.
    refused: Option<String>,
    /// Errors in percent, as [`Circuit::values`].
    errors: Vec<f64>,
    #[serde(with = "exact")]
    seconds: f64,
    #[serde(with = "exact")]
    shaft_deg: f64,
    /// Largest phase current as a share of the nameplate's peak.
    #[serde(with = "exact")]
    current: f64,
    /// The session in words, of a single one.
    told: Vec<String>,
}

impl Record {
    fn worst(&self) -> f64 {
        self.errors.iter().fold(0.0, |worst, error| error.abs().max(worst))
    }
}

impl Commission {
    fn machine(&self, number: usize) -> (Config, u64) {
        let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(number as u64);
        let config = match self.machines {
            Some(_) => drawn(&self.config, seed),
            None => self.config.clone(),
        };
        (config, seed)
    }
}

impl Study for Commission {
    type Record = Record;
    const EXPERIMENT: &'static Experiment = &EXPERIMENT;

    fn new(context: &Context<'_>) -> Result<Self, Error> {
        let mut config = context.config.clone();
        config.prepare.learn = false;
        let machines = config.extent.runs.map(|runs| runs as usize);
        Ok(Self { config, seed: context.seed, machines })
    }

    fn runs(&self) -> usize {
        self.machines.unwrap_or(1)
    }

    fn run(&self, number: usize) -> Result<Record, Error> {
        let (config, seed) = self.machine(number);
        let settings = unaware(&config);
        let unaware = Config { drive: settings, ..config.clone() };
        let rig = Rig::from_config(&unaware, seed)?;
        let steps = (Step::Nameplate, Step::Leakage);
        let commissioning = Commissioning::new(&settings);
        let session = Session::run(rig, commissioning, steps, Abort::default(), |_| {})?;
        let refused = session.refusal().map(|(step, why)| format!("{step:?}: {why}"));
        let m = session.commissioning.settings(&settings).motor;
        let found = Circuit::of([m.r_s, m.r_r, m.l_ls, m.l_lr, m.l_m].map(f64::from));
        let truth = Circuit::of_plant(&config);
        let pairs = found.values().into_iter().zip(truth.values());
        let errors = pairs.map(|((_, found), (_, truth))| 100.0 * (found / truth - 1.0)).collect();
        let mut told = Vec::new();
        for (at, report) in session.reports.iter().filter(|_| self.machines.is_none()) {
            told.extend(report.values.iter().flatten().map(|value| format!("  {value}")));
            told.push(format!("{at:.2} s  {report}"));
        }
        Ok(Record {
            errors: if refused.is_some() { Vec::new() } else { errors },
            refused,
            seconds: session.seconds,
            shaft_deg: session.shaft_deg,
            current: session.largest_a / f64::from(settings.rated_a()),
            told,
        })
    }

    fn outcome(&self, _: &Context<'_>, records: Vec<Record>) -> Result<Outcome, Error> {
        let mut outcome = Outcome::default();
        let accepted: Vec<&Record> = records.iter().filter(|r| r.refused.is_none()).collect();
        let m = &mut outcome.metrics;
        m.set("machines", records.len() as f64);
        m.set("accepted", accepted.len() as f64);
        m.set("refused", (records.len() - accepted.len()) as f64);
        let wrong = accepted.iter().filter(|r| r.worst() > RIGHT_PCT).count();
        m.set("wrongly_accepted", wrong as f64);
        let names = Circuit::of_plant(&self.config).values().map(|(name, _)| name);
        for (n, name) in names.into_iter().enumerate() {
            let sizes = sorted(accepted.iter().map(|r| r.errors[n].abs()));
            m.set(format!("error_q95_pct.{name}"), quantile(&sizes, 0.95));
            m.set(format!("error_max_pct.{name}"), quantile(&sizes, 1.0));
        }
        let seconds = sorted(accepted.iter().map(|r| r.seconds));
        m.set("seconds_median", quantile(&seconds, 0.5));
        m.set("seconds_max", quantile(&seconds, 1.0));
        m.set("shaft_deg_max", records.iter().map(|r| r.shaft_deg).fold(0.0, f64::max));
        m.set("current_max_of_peak", records.iter().map(|r| r.current).fold(0.0, f64::max));

        let mut heads = vec!["machine"];
        heads.extend(names);
        heads.extend(["seconds", "shaft (°)", "result"]);
        let mut table = Table::new("Sessions, the worst first; errors in %", &heads);
        let mut by_error: Vec<(usize, &Record)> = records.iter().enumerate().collect();
        by_error.sort_by(|(_, a), (_, b)| {
            b.refused.is_some().cmp(&a.refused.is_some()).then(b.worst().total_cmp(&a.worst()))
        });
        for (number, record) in by_error.into_iter().take(LISTED) {
            let errors = (0..names.len()).map(|n| match record.errors.get(n) {
                Some(error) => Cell::fixed(*error, 2),
                None => Cell::from("-"),
            });
            let mut row = vec![Cell::from(number.to_string())];
            row.extend(errors);
            row.extend([Cell::fixed(record.seconds, 1), Cell::fixed(record.shaft_deg, 3)]);
            row.push(Cell::from(record.refused.clone().unwrap_or_else(|| "accepted".into())));
            table.row(row);
        }
        outcome.tables.push(table);
        outcome.remarks.extend(records.iter().flat_map(|r| r.told.clone()));
        Ok(outcome)
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The smallest value that this share of the sorted values does not exceed; not a number without values.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted.get(place.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}
