//! The commissioning: one session on the motor of the configuration, or statistics over random machines around it.

pub mod refusals;
mod session;

use drive_commission::Step;
use drive_core::filter::LPF;
use drive_core::io::PERIOD_S;
use drive_settings::tuning::{EquivalentCircuit, current_loop_margins, motor_plant};

use super::drawn_machine::{Circuit, drawn};
use super::{machines, steady};
use crate::prelude::*;
use crate::stats::exact;
pub(super) use session::{Outside, Session, unaware};

/// Errors, in percent, of [`Circuit::values`] and of the gain mismatch, for a linear machine and for one with
/// saturation. Twice these errors count as wrong.
const RIGHT_PCT: [f64; 6] = [1.5, 1.5, 1.5, 1.5, 1.5, 0.5];
const RIGHT_IRON_PCT: [f64; 6] = [2.0, 2.0, 6.0, 6.0, 6.0, 0.5];
/// Time of each run after the commissioning, s, unless `seconds` sets another.
const RUN_S: f64 = 2.0;
/// Share of the expected saliency above which a machine counts as sufficiently salient.
const ENOUGH: f64 = 0.7;
/// Number of machines in the table, worst first.
const LISTED: usize = 20;

/// Returns the settings that `accept` then puts into force. The inertia, which needs a free shaft, is the one of the configuration.
///
/// # Errors
/// If the commissioning is refused, or does not end.
pub fn commissioned(config: &Config, seed: u64) -> Result<Settings, Error> {
    let session = Session::run(config, seed, &Outside::NONE)?;
    if let Some((step, why)) = session.refusal() {
        return Err(Error::Refused(format!("commissioning: {}: {why}", step.word())));
    }
    let mut settings = session.commissioning.settings(&unaware(config));
    settings.inertia = config.drive.inertia;
    Ok(settings)
}

/// The sessions.
pub struct Commission {
    config: Config,
    seed: u64,
    machines: Option<usize>,
    /// Seconds of each run after the commissioning, if there are any.
    after: Option<f64>,
}

/// A session of the statistics.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Record {
    /// Reason why the session was refused.
    refused: Option<String>,
    /// Errors in percent of [`Circuit::values`] and of the gain mismatch.
    errors: Vec<f64>,
    /// Time of the steps up to the leakage, of the magnetising-curve test, and of the current loop, s.
    seconds: f64,
    staircase_seconds: f64,
    loop_seconds: f64,
    shaft_deg: f64,
    /// Largest phase current as a share of the nameplate's peak.
    #[serde(with = "exact")]
    current: f64,
    /// Phase margin of the current loop on the true plant, degrees.
    #[serde(with = "exact")]
    margin_deg: f64,
    /// Whether its saliency is at least 0.7 of the expected value.
    salient: bool,
    /// The runs after the commissioning, if they were requested.
    after: Option<After>,
    /// The identified parameters, as [`Circuit::values`].
    found: Vec<f64>,
    /// The session in words: time, step and verdict; its values.
    told: Vec<(String, Vec<String>)>,
}

impl Record {
    /// Describes the result in words.
    fn result(&self) -> String {
        let accepted = match &self.after {
            None => "accepted",
            Some(Ok((true, _))) => "accepted, good afterwards",
            Some(Ok((false, _))) => "accepted, angle error too large afterwards",
            Some(Err(why)) => why,
        };
        self.refused.clone().unwrap_or_else(|| accepted.to_owned())
    }

    fn worst(&self) -> f64 {
        self.errors.iter().fold(0.0, |worst, error| error.abs().max(worst))
    }
}

/// Whether all runs after a commissioning are good, and the time of the saliency self-commissioning, s; or the reason why there are
/// no runs.
type After = Result<(bool, f64), String>;

/// Whether a commissioned drive, which learns with the shaft locked, is good at all operating points.
fn judged(config: &Config, drive: &Settings, seed: u64, seconds: f64) -> Result<After, Error> {
    let mut config = Config { drive: *drive, ..config.clone() };
    config.prepare.learn = true;
    config.drive.injection.synchronous.allow_unlearned = false;
    let learned = match or_refusal(steady::prepared(&config, seed))? {
        Ok(learned) => learned,
        Err(why) => return Ok(Err(why)),
    };
    let runs = machines::runs(&learned, &config, seed, seconds)?;
    Ok(Ok((machines::good(&runs), learned.learning_s)))
}

impl Commission {
    /// Makes the table of the results that are shown beside the filed ones.
    fn found_table(&self, record: &Record) -> Table {
        let mut table = Table::new("The motor", &["parameter", "found", "true", "error (%)"]);
        let units = ["ohm", "H", "ohm", "H", "s"];
        for (n, ((name, _), unit)) in
            Circuit::of_plant(&self.config).values().into_iter().zip(units).enumerate()
        {
            let pair = record.found.get(n).zip(record.errors.get(n));
            let pair = pair.filter(|_| record.refused.is_none());
            table.row([
                Cell::from(format!("{name} ({unit})")),
                Cell::fixed_or_dash(pair.map(|(found, _)| *found), 5),
                Cell::fixed_or_dash(pair.map(|(found, error)| found / (1.0 + 0.01 * error)), 5),
                Cell::fixed_or_dash(record.errors.get(n).copied(), 2),
            ]);
        }
        table.note("Inverse-Gamma circuit; with saturation at the magnetising current found, and the small-signal leakage at the bias.")
    }

    fn machine(&self, number: usize) -> (Config, u64) {
        let seed = seed_of(self.seed, number);
        let draws = self.machines.is_some();
        (if draws { drawn(&self.config, seed) } else { self.config.clone() }, seed)
    }
}

impl Study for Commission {
    type Record = Record;
    const NAME: &'static str = "commission";

    fn new(context: &Context<'_>) -> Result<(Self, usize), Error> {
        let mut config = context.config.clone();
        let after = config.prepare.learn.then(|| context.seconds.unwrap_or(RUN_S));
        config.prepare.learn = false;
        let machines = config.extent.runs.map(|runs| runs as usize);
        Ok((Self { config, seed: context.seed, machines, after }, machines.unwrap_or(1)))
    }

    fn run(&self, number: usize) -> Result<Record, Error> {
        let (config, seed) = self.machine(number);
        let settings = unaware(&config);
        let session = Session::run(&config, seed, &Outside::NONE)?;
        let refused = session.refusal().map(|(step, why)| format!("{}: {why}", step.word()));
        let commissioned = session.commissioning.settings(&settings);
        let [found, truth] = session.circuits(&config, &commissioned);
        let sensors = &config.measurement;
        let gains = (1.0 + sensors.gain_error_a) / (1.0 + sensors.gain_error_b);
        let mismatch = session.commissioning.found().levels.map_or(0.0, |levels| levels.mismatch);
        let mut errors = found.errors_pct(&truth).to_vec();
        errors.push(100.0 * (1.0 + f64::from(mismatch) - gains));
        let mut told = Vec::new();
        for (at, report) in session.reports.iter().filter(|_| self.machines.is_none()) {
            let values = report.values.iter().flatten().map(ToString::to_string).collect();
            told.push((format!("{at:.2} s: {report}"), values));
        }
        let margin_deg = match refused {
            None => margin(&commissioned, &truth)?,
            Some(_) => f64::NAN,
        };
        let after = self.after.filter(|_| refused.is_none());
        let after = after.map(|seconds| judged(&config, &commissioned, seed, seconds));
        let expected = f64::from(commissioned.injection.synchronous.flux_saliency);
        Ok(Record {
            found: found.values().map(|(_, value)| value).into(),
            margin_deg,
            salient: plant_settings(&config).saliency.a_psi.abs() >= ENOUGH * expected.abs(),
            after: after.transpose()?,
            errors: if refused.is_some() { Vec::new() } else { errors },
            refused,
            seconds: session.until(Step::Leakage),
            staircase_seconds: session.until(Step::Staircase) - session.until(Step::Leakage),
            loop_seconds: session.seconds - session.until(Step::Staircase),
            shaft_deg: session.shaft_deg,
            current: session.rig.peak_a / f64::from(settings.rated_a()),
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
        let linear = matches!(self.config.model.plant, PlantModel::A | PlantModel::Linear);
        let right = if linear { RIGHT_PCT } else { RIGHT_IRON_PCT };
        let is_wrong =
            |r: &&&Record| r.errors.iter().zip(right).any(|(e, most)| e.abs() > 2.0 * most);
        let wrong = accepted.iter().filter(is_wrong).count();
        m.set("wrongly_accepted", wrong as f64);
        let [r_s, leakage, rr, lm, tau_r] = Circuit::of_plant(&self.config).values().map(|v| v.0);
        let names = [r_s, leakage, rr, lm, tau_r, "mismatch"];
        for (n, name) in names.into_iter().enumerate() {
            let sizes = sorted(accepted.iter().map(|r| r.errors[n].abs()));
            m.set(format!("error_q95_pct.{name}"), quantile(&sizes, 0.95));
            m.set(format!("error_max_pct.{name}"), quantile(&sizes, 1.0));
        }
        let seconds = sorted(accepted.iter().map(|r| r.seconds));
        m.set("seconds_median", quantile(&seconds, 0.5));
        m.set("seconds_max", quantile(&seconds, 1.0));
        let longest = |of: fn(&Record) -> f64| accepted.iter().map(|r| of(r)).fold(0.0, f64::max);
        m.set("staircase_seconds_max", longest(|r| r.staircase_seconds));
        m.set("loop_seconds_max", longest(|r| r.loop_seconds));
        m.set("shaft_deg_max", records.iter().map(|r| r.shaft_deg).fold(0.0, f64::max));
        m.set("current_max_of_peak", records.iter().map(|r| r.current).fold(0.0, f64::max));

        let margins = sorted(accepted.iter().map(|r| r.margin_deg));
        m.set("margin_deg_min", margins.first().copied().unwrap_or(f64::NAN));
        let judged: Vec<_> = accepted.iter().filter(|r| r.after.is_some()).collect();
        if !judged.is_empty() {
            let good = |salient: Option<bool>| {
                let of = |r: &&&&Record| salient.is_none_or(|wanted| r.salient == wanted);
                let all: Vec<_> = judged.iter().filter(of).collect();
                let good = all.iter().filter(|r| matches!(r.after, Some(Ok((true, _))))).count();
                good as f64 / all.len() as f64
            };
            m.set("good_after", good(None));
            m.set("good_after_salient", good(Some(true)));
            m.set("good_after_weak", good(Some(false)));
            let lost = judged.iter().filter(|r| matches!(r.after, Some(Err(_)))).count();
            m.set("refused_after", lost as f64);
            let learned = |r: &&Record| match r.after {
                Some(Ok((_, seconds))) => {
                    let steps = r.seconds + r.staircase_seconds + r.loop_seconds;
                    Some((seconds, steps + seconds))
                }
                _ => None,
            };
            let learned: Vec<(f64, f64)> = accepted.iter().filter_map(learned).collect();
            let learning = sorted(learned.iter().map(|(learning, _)| *learning));
            let all = sorted(learned.iter().map(|(_, all)| *all));
            for (name, seconds) in [("learning_seconds", learning), ("all_seconds", all)] {
                m.set(format!("{name}_median"), quantile(&seconds, 0.5));
                m.set(format!("{name}_max"), quantile(&seconds, 1.0));
            }
        }

        let mut by_error: Vec<(usize, &Record)> = records.iter().enumerate().collect();
        by_error.sort_by(|(_, a), (_, b)| {
            b.refused.is_some().cmp(&a.refused.is_some()).then(b.worst().total_cmp(&a.worst()))
        });
        let mut columns = columns![|n, _: &Record| "machine" => Cell::from(n.to_string());];
        columns.extend(names.into_iter().enumerate().map(|(n, head)| Column {
            head,
            cell: Box::new(move |_, r: &Record| Cell::fixed_or_dash(r.errors.get(n).copied(), 2)),
        }));
        columns.extend(columns![|_, r: &Record|
            "seconds" => Cell::fixed(r.seconds, 1);
            "shaft (°)" => Cell::fixed(r.shaft_deg, 3);
            "result" => Cell::from(r.result());
        ]);
        let (title, listed) = ("Sessions, the worst first; errors in %", by_error.into_iter());
        outcome.tables.push(Table::of(title, &columns, listed.take(LISTED)));
        if let (None, [record]) = (self.machines, records.as_slice()) {
            outcome.tables = vec![session_table(record), self.found_table(record)];
        }
        Ok(outcome)
    }
}

/// Makes the table of the session: steps with their values and verdicts.
fn session_table(record: &Record) -> Table {
    let heads = ["step and verdict", "found, and what nameplate and noise allow"];
    let mut table = Table::new("The session", &heads);
    for (step, values) in &record.told {
        let first = values.first().map_or("", String::as_str);
        table.row([step.as_str(), first].map(Cell::from));
        values.iter().skip(1).for_each(|value| table.row(["", value].map(Cell::from)));
    }
    table
}

/// Phase margin, degrees, of the current loop of these settings on the true plant.
fn margin(settings: &Settings, truth: &Circuit) -> Result<f64, Error> {
    built(settings)?;
    let [design, _] = settings.current_loops().map_err(Error::refused)?;
    // In this circuit the whole leakage inductance lies on the stator's side.
    let Circuit { r_s, r_r, leakage: l_ls, coupled: l_m } = *truth;
    let circuit = EquivalentCircuit { r_s, r_r, l_ls, l_m, l_lr: 1e-9 };
    let period = f64::from(PERIOD_S);
    let plant = motor_plant(&circuit, period).map_err(Error::refused)?;
    let (k_c, z_c) = (design.k_c, design.z_c);
    let margins = current_loop_margins(k_c, z_c, plant, &LPF.sections, period);
    Ok(margins.map_err(Error::refused)?.phase_margin_deg)
}
