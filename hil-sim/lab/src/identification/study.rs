//! Mean errors of many simulated measurements (Eq. 45), beside the printed ones.

use rayon::prelude::*;
use sim_bench::outcome::Entry;

use super::models::{model_b, model_c, model_d};
use super::printed::{
    PERIODS, SPEEDS, TABLE_1, TABLE_4, TABLE_5, TABLES_2_3_B, TABLES_2_3_C, column,
};
use super::structured::model_s;
use super::trial::Noise;
use super::{CurrentVoltage, Estimate, Parameters, Signal, Trial};

/// One column of the tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Speed, electrical rad/s.
    pub speed: f64,
    /// The excitation.
    pub signal: Signal,
    /// Which of the sampling periods.
    pub period: usize,
}

impl Case {
    /// All twelve, in the order of the tables.
    pub fn all() -> Vec<Self> {
        let mut cases = Vec::new();
        for speed in SPEEDS {
            for signal in Signal::ALL {
                cases.extend((0..PERIODS.len()).map(|period| Self { speed, signal, period }));
            }
        }
        cases
    }

    /// Sampling period, s.
    pub fn h(&self) -> f64 {
        PERIODS[self.period]
    }
}

/// Models that give the five parameters.
pub const MODELS: [&str; 4] = ["B", "C", "D", "S"];

/// Mean absolute error of one number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    /// In %, over the measurements in which it was identifiable.
    pub percent: f64,
    /// Measurements in which it was not.
    pub missing: u32,
}

/// The errors of one column.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    /// The column.
    pub case: Case,
    /// Model A, in the order of [`CurrentVoltage::NAMES`].
    pub discrete: [Mean; 8],
    /// [`MODELS`], each in the order of [`Parameters::NAMES`].
    pub continuous: [[Mean; 5]; 4],
}

fn mean(errors: impl Iterator<Item = Option<f64>>) -> Mean {
    let (mut sum, mut count, mut missing) = (0.0, 0u32, 0);
    for error in errors {
        match error {
            Some(error) => (sum, count) = (sum + error.abs(), count + 1),
            None => missing += 1,
        }
    }
    Mean { percent: if count > 0 { 100.0 * sum / f64::from(count) } else { 100.0 }, missing }
}

/// The errors of one column over `trials` measurements of `machine`. Where no measurement gives a
/// number, its error counts as 100 %.
pub fn errors(machine: Parameters, case: Case, noise: Noise, seed: u64, trials: u64) -> Errors {
    let (machine, h) = (machine.at(case.speed), case.h());
    let trial = Trial::printed(machine, case.signal, h, noise);
    // The true coefficients of Tables 1 and 4: series to h^5.
    let coefficients = machine.continuous().series(h, 5).current_voltage().array();
    let one = |m: u64| {
        let data = trial.run(seed, m);
        let regression = match data.regression() {
            Ok(regression) => regression,
            Err(reason) => return (None, [Estimate::none(reason); 4]),
        };
        let b = data.first_order().map(|theta| model_b(&theta, h));
        let s = model_s(&regression, h, None).map(|fit| Estimate::from(fit.parameters));
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

/// All twelve columns.
pub fn all(machine: Parameters, noise: Noise, seed: u64, trials: u64) -> Vec<Errors> {
    Case::all().into_iter().map(|case| errors(machine, case, noise, seed, trials)).collect()
}

impl Errors {
    fn entry(&self, model: &'static str, parameter: &'static str, ours: Mean) -> Entry {
        Entry {
            model,
            signal: self.case.signal.name(),
            speed_rad_s: self.case.speed,
            h_us: (1e6 * self.case.h()).round(),
            parameter,
            printed_pct: None,
            ours_pct: ours.percent,
        }
    }

    /// Model A, beside Tables 1 and 4.
    pub fn discrete_entries(&self) -> Vec<Entry> {
        let table = if self.case.speed == SPEEDS[0] { &TABLE_1 } else { &TABLE_4 };
        let column = column(self.case.signal, self.case.period);
        let entry = |k: usize| Entry {
            printed_pct: Some(table[k][column]),
            ..self.entry("A", CurrentVoltage::NAMES[k], self.discrete[k])
        };
        (0..8).map(entry).collect()
    }

    /// Models B, C, D and S, beside Tables 2, 3 and 5.
    pub fn continuous_entries(&self) -> Vec<Entry> {
        let column = column(self.case.signal, self.case.period);
        let mut entries = Vec::new();
        for (index, model) in MODELS.into_iter().enumerate() {
            let table = match (model, self.case.speed == SPEEDS[0]) {
                ("B", true) => Some(&TABLES_2_3_B),
                ("C", true) => Some(&TABLES_2_3_C),
                ("C", false) => Some(&TABLE_5),
                _ => None,
            };
            entries.extend((0..5).map(|k| Entry {
                printed_pct: table.map(|table| table[k][column]),
                ..self.entry(model, Parameters::NAMES[k], self.continuous[index][k])
            }));
        }
        entries
    }
}
