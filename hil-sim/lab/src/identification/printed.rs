//! Tables 1 to 5 as printed: mean absolute errors in % (Eq. 45).

use super::Signal;
use crate::source;

/// Sampling periods of all tables, s.
pub const PERIODS: [f64; 3] = [50e-6, 100e-6, 200e-6];
/// Speeds of Tables 1 to 3 (60 Hz) and of Tables 4 and 5 (10 Hz), electrical rad/s.
pub const SPEEDS: [f64; 2] = [375.0, 61.0];

/// One column of the tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Speed, electrical rad/s.
    pub speed: f64,
    /// The excitation.
    pub signal: Signal,
    /// Index of the sampling period.
    pub period: usize,
}

impl Case {
    /// Returns all twelve columns, in the order of the tables.
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

/// Place and quantity of an error in the list: an error of one of the five parameters, by a model, at one of [`SPEEDS`]
/// and one of [`PERIODS`]. The tables have Model A at both speeds, B at the first, C at both.
pub fn place(model: &str, case: Case, parameter: &str) -> [String; 2] {
    let Case { speed, signal, period } = case;
    let table = match (model, speed == SPEEDS[0], signal) {
        ("A", true, _) => "Table 1".to_owned(),
        ("A", false, _) => "Table 4".to_owned(),
        (_, true, Signal::SixStep) => format!("Table 2, {model}"),
        (_, true, Signal::Schroeder) => format!("Table 3, {model}"),
        _ => "Table 5".to_owned(),
    };
    let micros = 1e6 * PERIODS[period];
    [format!("{table}, {parameter}"), format!("{} {micros:.0} us", signal.name())]
}

/// The printed error, %.
pub fn error(model: &str, case: Case, parameter: &str) -> Option<f64> {
    let printed = ["A", "C"].contains(&model) || (model == "B" && case.speed == SPEEDS[0]);
    let [place, quantity] = place(model, case, parameter);
    printed.then(|| source::number("S0", &place, &quantity))
}
