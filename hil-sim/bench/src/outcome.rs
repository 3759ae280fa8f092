//! The outcome of an experiment: numbers, tables and figures, and their JSON form.
#![deny(clippy::use_debug)]

mod figure;
mod json;
pub mod name;
mod table;

pub use figure::{Curve, Figure, Panel, Series, Style};
pub use json::{SCHEMA_VERSION, joined};
pub use table::{Cell, Column, Table};

/// The outcome of an experiment.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Numbers by name; a name ends in its unit, like `angle_error_rms_deg`.
    pub metrics: Metrics,
    /// The current levels of a torque experiment.
    pub steps: Option<Vec<Step>>,
    /// Tables, in reading order.
    pub tables: Vec<Table>,
    /// Printed values of the sources beside our values.
    pub compared: Vec<Compared>,
    /// Figures, in reading order.
    pub figures: Vec<Figure>,
    /// Texts that are shown line by line as they are, with their titles.
    pub texts: Vec<(String, String)>,
    /// Remarks for the reader: differences from the source, assumptions, limits.
    pub remarks: Vec<String>,
    /// Texts of the faults with which the drive stopped itself although it should have continued; empty for a run that
    /// ended as it should.
    pub faults: Vec<String>,
    /// The reason why the experiment was refused; it has no results then.
    pub refusal: Option<String>,
}

/// Largest number of faults in the text about a failed run; the JSON has all.
const MOST_FAULTS: usize = 10;

/// Numbers by name, in the order in which they were added.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Metrics(#[serde(serialize_with = "json::as_map")] Vec<(String, f64)>);

impl Metrics {
    /// Adds a number, or replaces the number of this name.
    pub fn set(&mut self, name: impl Into<String>, value: f64) {
        let name = name.into();
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some(entry) => entry.1 = value,
            None => self.0.push((name, value)),
        }
    }

    /// Returns the number of this name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.iter().find(|(known, _)| *known == name).map(|(_, value)| value)
    }

    /// Returns all names and numbers.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, value)| (name.as_str(), *value))
    }

    /// Formats a number for the reader: `yes` or `no` for a metric that is called `lost`, four digits otherwise.
    pub fn cell(name: &str, value: f64) -> Cell {
        match value {
            0.0 if is_flag(name) => Cell::from("no"),
            1.0 if is_flag(name) => Cell::from("yes"),
            whole if whole.fract() == 0.0 && whole.abs() < 1e6 => Cell::fixed(whole, 0),
            other => Cell::significant(other, 4),
        }
    }

    /// Returns the most important number: the angle error, or otherwise the first number that is not a count of runs.
    pub fn main(&self) -> Option<(&str, f64)> {
        let is = |wanted: &str| self.iter().find(|(name, _)| *name == wanted);
        let counts = |name: &str| is_flag(name) || name.ends_with("runs") || name == "machines";
        let numbers = |entry: &(&str, f64)| !counts(entry.0) && entry.1.is_finite();
        is("angle_error_rms_deg").or_else(|| self.iter().find(numbers))
    }

    /// Returns whether anything was lost, and of how many runs if they are counted. Empty if nothing could be lost.
    pub fn lost(&self) -> String {
        match (self.get("lost_runs").or(self.get("lost")), self.get("runs")) {
            (None, _) => String::new(),
            (Some(lost), Some(runs)) => format!("{lost} of {runs}"),
            (Some(lost), None) => (if lost == 0.0 { "no" } else { "yes" }).to_owned(),
        }
    }
}

fn is_flag(name: &str) -> bool {
    name == "lost" || name.ends_with("_lost")
}

/// One current level of a torque experiment, averaged over its settled part.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Step {
    /// Reference of the q-axis current, A peak.
    pub iq_ref_a: f64,
    /// q-axis current, A peak.
    pub iq_a: f64,
    /// Torque of the motor, Nm.
    pub torque_nm: f64,
    /// True minus estimated rotor flux angle, electrical degrees.
    pub angle_error_mean_deg: f64,
}

/// The origin of the value that stands beside a printed one, weakest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Against {
    /// There is no such value.
    #[default]
    Nothing,
    /// The source's own numbers alone: no change of the program can make it differ.
    Print,
    /// A constant, a filter, a design or a method of the program.
    Program,
    /// The drive, or the method of the source, on the simulated motor.
    Simulation,
}

impl Against {
    /// Returns its name on the page.
    pub fn name(self) -> &'static str {
        ["nothing", "print", "program", "simulation"][self as usize]
    }
}

/// A printed value of a source beside ours, in the printed unit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Compared {
    /// `S0` or `S1`.
    pub source: &'static str,
    /// Where it is printed: `Eq. 3.20`, `Table 6, 1.5 A`.
    pub place: String,
    /// Its symbol or name.
    pub quantity: String,
    /// Value computed without a simulation: from the source's own numbers, or by the program.
    pub recomputed: Option<f64>,
    /// Value from the drive, or from the method of the source, on the simulated motor.
    pub simulated: Option<f64>,
    /// The strongest origin of these values.
    pub against: Against,
    /// Smallest and largest value over seeds, of a mean over random runs.
    pub seeds: Option<[f64; 2]>,
    /// The constant that the program uses for it.
    pub used: Option<f64>,
    /// A reason for a relative difference, and its largest permitted amount.
    pub but: Option<(&'static str, f64)>,
    /// The quantity that the source does not state, if the value cannot be known without it.
    pub unknown: Option<&'static str>,
}

impl Compared {
    /// Makes a printed value of a source, with no value of ours yet.
    pub fn with(
        source: &'static str,
        place: impl Into<String>,
        quantity: impl Into<String>,
    ) -> Self {
        Self { source, place: place.into(), quantity: quantity.into(), ..Self::default() }
    }

    /// Adds the quantity that the source does not state and on which the value depends.
    pub fn unknown(self, what: &'static str) -> Self {
        Self { unknown: Some(what), ..self }
    }

    /// Adds the value from the source's own numbers alone, or whether a claim holds by them.
    pub fn of_print(self, value: impl Into<f64>) -> Self {
        let against = self.against.max(Against::Print);
        Self { recomputed: Some(value.into()), against, ..self }
    }

    /// Adds the value that the program computes, or whether a claim holds by it.
    pub fn recomputed(self, value: impl Into<f64>) -> Self {
        Self { against: Against::Program, ..self.of_print(value) }
    }

    /// Adds the constant that the program uses.
    pub fn used(self, value: f64) -> Self {
        Self { used: Some(value), against: self.against.max(Against::Program), ..self }
    }

    /// Adds the value from the simulated motor, or whether a claim holds for it.
    pub fn simulated(self, value: impl Into<f64>) -> Self {
        Self { simulated: Some(value.into()), against: Against::Simulation, ..self }
    }

    /// Returns the value that an erratum shows: the recomputed one, otherwise the simulated one, otherwise the constant of the program.
    pub fn value(&self) -> Option<f64> {
        self.recomputed.or(self.simulated).or(self.used)
    }
}

/// Seed and settings that led to an outcome.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Names and values of the changed settings.
    pub settings: Vec<(String, String)>,
}

impl Origin {
    /// Makes an origin from the seed and the changed settings, each `NAME=VALUE`.
    pub fn new(seed: u64, changes: &[String]) -> Self {
        let pairs = changes.iter().filter_map(|change| change.split_once('='));
        let settings = pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
        Self { seed, settings }
    }
}

impl Outcome {
    /// Adds a remark.
    pub fn remark(&mut self, text: impl Into<String>) {
        self.remarks.push(text.into());
    }

    /// Returns the outcome of an experiment that was refused.
    pub fn refused(reason: &impl std::fmt::Display) -> Self {
        Self { refusal: Some(reason.to_string()), ..Self::default() }
    }

    /// Returns in words whether the experiment was refused, whether the drive lost its angle or stopped itself, and the
    /// faults; nothing for a run that ended as it should.
    pub fn lost(&self) -> Option<String> {
        if let Some(reason) = &self.refusal {
            return Some(format!("Refused: {reason}"));
        }
        let lost = self.metrics.get("lost");
        let whether = if lost.is_some() { "Lost" } else { "The drive stopped itself" };
        match self.faults.as_slice() {
            [] => (lost == Some(1.0)).then(|| {
                format!("{whether}: the drive stopped itself, or its flux angle was wrong beyond recovery.")
            }),
            faults => {
                let shown = &faults[..faults.len().min(MOST_FAULTS)];
                let more = match faults.len() - shown.len() {
                    0 => String::new(),
                    more => format!("; and {more} more"),
                };
                Some(format!("{whether}: {}{more}.", shown.join("; ")))
            }
        }
    }
}
