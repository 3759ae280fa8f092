//! Mean errors of many simulated measurements (Eq. 45), beside the printed errors.

use super::printed::{self, Case};
use super::structured::model_s;
use super::{CurrentVoltage, Estimate, Noise, Parameters, Trial, model_b, model_c, model_d};

use crate::prelude::*;

/// Models that give the five parameters.
pub const MODELS: [&str; 4] = ["B", "C", "D", "S"];

/// The errors of one column.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// The column.
    pub case: Case,
    /// Mean absolute errors of Model A, %, in the order of [`CurrentVoltage::NAMES`].
    pub discrete: [f64; 8],
    /// Mean absolute errors of [`MODELS`], %, each in the order of [`Parameters::NAMES`].
    pub continuous: [[f64; 5]; 4],
}

/// Mean of the errors, %, over the measurements that give an error.
fn mean(errors: impl Iterator<Item = Option<f64>>) -> f64 {
    let errors: Vec<_> = errors.flatten().map(f64::abs).collect();
    let sum: f64 = errors.iter().sum();
    if errors.is_empty() { 100.0 } else { 100.0 * sum / errors.len() as f64 }
}

/// Errors of one column over `trials` measurements of `machine`. If no measurement gives a number, its error counts as
/// 100 %.
pub fn errors(machine: Parameters, case: Case, noise: Noise, seed: u64, trials: u64) -> Errors {
    let trial = Trial::printed(machine.at(case.speed), case.signal, case.h(), noise);
    errors_of(&trial, case, seed, trials)
}

/// As [`errors`], with a measurement that may have another supply.
pub fn errors_of(trial: &Trial, case: Case, seed: u64, trials: u64) -> Errors {
    let (machine, h) = (trial.machine, case.h());
    // The true coefficients of Tables 1 and 4: series to h^5.
    let coefficients = machine.continuous().series(h, 5).current_voltage().array();
    let one = |m: u64| {
        let data = trial.run(seed, m);
        let regression = match data.regression() {
            Ok(regression) => regression,
            Err(reason) => return (None, [Estimate::none(reason); 4]),
        };
        let b = data.first_order().map(|theta| model_b(&theta, h));
        let s = model_s(&regression, h).map(|fit| Estimate::from(fit.parameters));
        let estimates = [
            b.unwrap_or_else(Estimate::none),
            model_c(&regression.delta, h),
            model_d(&regression.delta, h),
            s.unwrap_or_else(Estimate::none),
        ];
        (Some(regression.delta.current_voltage().array()), estimates)
    };
    let results: Vec<_> = (0..trials).into_par_iter().map(one).collect();
    let truth = machine.array();
    let relative = |value: f64, truth: f64| value / truth - 1.0;
    Errors {
        case,
        discrete: std::array::from_fn(|k| {
            mean(results.iter().map(|(a, _)| a.map(|a| relative(a[k], coefficients[k]))))
        }),
        continuous: std::array::from_fn(|model| {
            std::array::from_fn(|k| {
                let value = |e: &[Estimate; 4]| e[model].array()[k].ok();
                mean(results.iter().map(|(_, e)| value(e).map(|value| relative(value, truth[k]))))
            })
        }),
    }
}

/// The error of one estimated parameter: the printed one, if there is one, and ours.
#[derive(Clone, Debug)]
pub struct Entry {
    /// `A`, or one of [`MODELS`].
    pub model: &'static str,
    /// The column.
    pub case: Case,
    /// `r_s`, `tau_r`, `sigma_l_s`, `l_s`, `omega_m`, or a coefficient like `f_1a`.
    pub parameter: &'static str,
    /// Printed error, %.
    pub printed_pct: Option<f64>,
    /// Our error, %.
    pub ours_pct: f64,
    /// Mean of our error over seeds, %.
    pub mean_pct: f64,
}

impl Entry {
    /// Our error divided by the printed one.
    pub fn ratio(&self) -> Option<f64> {
        self.printed_pct.map(|printed| self.ours_pct / printed)
    }

    /// Whether our error and the printed one differ by no more than this factor.
    pub fn within(&self, factor: f64) -> bool {
        self.ratio().is_some_and(|ratio| ratio <= factor && ratio * factor >= 1.0)
    }
}

/// Share of the printed entries within a factor of two.
pub fn share(entries: &[Entry]) -> f64 {
    let printed = entries.iter().filter(|e| e.printed_pct.is_some()).count();
    entries.iter().filter(|e| e.within(2.0)).count() as f64 / printed as f64
}

impl Errors {
    /// Lists the errors of some models (`A` and [`MODELS`]), beside Tables 1 to 5.
    pub fn entries(&self, models: &[&'static str]) -> Vec<Entry> {
        let case = self.case;
        let of_model = |model: &&'static str| -> Vec<Entry> {
            let place = MODELS.iter().position(|known| known == model);
            let (names, errors): (&[&'static str], &[f64]) = match place {
                Some(place) => (&Parameters::NAMES, &self.continuous[place]),
                None => (&CurrentVoltage::NAMES, &self.discrete),
            };
            let entry = |(&parameter, &ours_pct): (&&'static str, &f64)| {
                let printed_pct = printed::error(model, case, parameter);
                Entry { model, case, parameter, printed_pct, ours_pct, mean_pct: ours_pct }
            };
            names.iter().zip(errors).map(entry).collect()
        };
        models.iter().flat_map(of_model).collect()
    }
}

/// Measurements of a column, M.
pub const TRIALS: u64 = 7;
/// Number of seeds for the spread.
const SEEDS: usize = 5;

/// Computes the errors of some models in all columns with half the printed noise, beside the printed errors and with
/// their spread over seeds. The shares within a factor of two, with that noise and with the printed noise, become
/// metrics.
pub fn tables(
    context: &Context<'_>,
    models: &[&'static str],
) -> Result<(Vec<Entry>, Outcome), Error> {
    let all = |noise, seed| -> Vec<Entry> {
        let one = |case| errors(Parameters::PX, case, noise, seed, TRIALS).entries(models);
        Case::all().into_iter().flat_map(one).collect()
    };
    let seeds = context.in_parallel("identification", &[(); SEEDS], |n, ()| {
        Ok(all(Noise::HALF, context.seed + n))
    })?;
    let mut outcome = Outcome::default();
    let mut entries = seeds[0].clone();
    for (k, entry) in entries.iter_mut().enumerate() {
        entry.mean_pct = Stats::of(seeds.iter().map(|seed| seed[k].ours_pct)).mean();
    }
    for (k, entry) in entries.iter().enumerate().filter(|(_, entry)| entry.printed_pct.is_some()) {
        let over = sorted(seeds.iter().map(|seed| seed[k].ours_pct));
        let ends = [over[0], over[over.len() - 1]];
        let [place, quantity] = printed::place(entry.model, entry.case, entry.parameter);
        let ours = Compared { seeds: Some(ends), ..Compared::with("S0", place, quantity) };
        outcome.compared.push(ours.simulated(entry.ours_pct));
    }
    outcome.metrics.set("within_factor_2", share(&entries));
    let literal = share(&all(Noise::PRINTED, context.seed));
    outcome.metrics.set("within_factor_2_printed_noise", literal);
    texts::add_remarks(&mut outcome, "identification", &[]);
    Ok((entries, outcome))
}
