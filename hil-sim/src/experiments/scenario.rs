//! Runs over time: the commands to the drive part by part, the motion of its shaft, the recorded quantities and the judgement.
//!
//! A scenario is a TOML file, or, for the experiment `profile`, the rows of a CSV file. `hil-sim/scenarios/` has the
//! files of the program; its `README.md` describes their keys.

mod file;
mod quantity;
mod record;

pub use file::{Metric, Statistic};
pub use quantity::{QUANTITIES, Seen};
pub use record::Record;

use include_dir::{Dir, include_dir};

use self::file::Text;
use super::course::Ramp;
use crate::prelude::*;

/// The scenarios of the program; the file of an experiment has its name.
static SHIPPED: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/scenarios");

/// Runs the scenario of the program with this name.
///
/// # Errors
/// [`Error::Internal`] if there is none; as [`Scenario::outcome`].
pub fn shipped(name: &str, context: &Context<'_>) -> Result<Outcome, Error> {
    Scenario::shipped(name, context.config)?.outcome(context)
}

/// Runs a scenario with references and a load in the rows of a CSV file.
///
/// # Errors
/// [`Error::Refused`] without a file; as [`Scenario::of_csv`] and [`Scenario::outcome`].
pub fn profile(context: &Context<'_>) -> Result<Outcome, Error> {
    let path = context.file.ok_or_else(|| Error::Refused("profile needs --input FILE".into()))?;
    Scenario::of_csv(path, context.config)?.outcome(context)
}

/// Returns the scenario of a TOML file, with the name of the file; none for a name that is not a TOML file. The name
/// lasts as long as the program.
pub fn own(name: &str) -> Option<Experiment> {
    let stem = Path::new(name.strip_suffix(".toml")?).file_name()?.to_string_lossy();
    let own = Experiment::new("scenario", |context| {
        Scenario::read(context.file.unwrap_or(Path::new("")), context.config)?.outcome(context)
    });
    Some(Experiment { name: stem.into_owned().leak(), ..super::described(own) })
}

/// Records the step of five turns with an encoder, for the comparison with one without. The settings of the scenario
/// apply only to the run with the encoder.
///
/// # Errors
/// As [`Scenario::record`].
pub fn position_step(context: &Context<'_>, encoder: bool, seconds: f64) -> Result<Record, Error> {
    let mut scenario = Scenario::shipped("position-step", context.config)?;
    if !encoder {
        scenario.settings.clear();
    }
    scenario.record(&Context { seconds: Some(seconds), progress: Progress::hidden(), ..*context })
}

/// A quantity that the drive regulates.
struct Reference {
    /// Its name in files.
    column: &'static str,
    mode: Mode,
    command: fn(f32) -> Command,
    actual: fn(&Point) -> f64,
}

/// The three regulated quantities, of which a run uses one.
#[rustfmt::skip] // one a line
static REFERENCES: [Reference; 3] = [
    Reference { column: "torque_current_a", mode: Mode::Torque, command: Command::Torque, actual: |p| p.iq },
    Reference { column: "speed_rpm", mode: Mode::Speed, command: Command::Speed, actual: |p| p.speed_rpm },
    Reference { column: "position_turns", mode: Mode::Position, command: Command::Position, actual: |p| p.turns },
];

/// The shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Shaft {
    /// As the configuration sets it.
    #[default]
    AsSet,
    /// Free against a torque, Nm.
    Free,
    /// Held at a speed by a dynamometer, rpm.
    Held,
}

/// A part of a run, in the units of the drive.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// Beginning and duration, s; the duration of a step is zero.
    begin: f64,
    seconds: f64,
    reference: Ramp,
    /// Torque or speed of the shaft.
    load: Ramp,
    /// Stop command at the beginning.
    stop: Option<Stop>,
    start: bool,
}

impl Part {
    /// Returns a value of the part at a time; after the end the last value holds.
    fn at(&self, Ramp(from, to): Ramp, t: f64) -> f64 {
        let share = (t - self.begin) / self.seconds;
        if share < 1.0 { from + share * (to - from) } else { to }
    }
}

/// A scenario.
#[derive(Default)]
pub struct Scenario {
    /// The regulated quantity; a scenario from a file always has one.
    reference: Option<&'static Reference>,
    shaft: Shaft,
    parts: Vec<Part>,
    /// Settings that apply where the configuration has the default.
    settings: Vec<(String, toml::Value)>,
    /// Whether it comes from rows: then `--seconds` cuts or extends it, instead of stretching it.
    from_rows: bool,
    /// Figures, metrics and judgement.
    text: Text,
}

impl Scenario {
    fn shipped(name: &str, config: &Config) -> Result<Self, Error> {
        let missing = || Error::Internal(format!("scenarios/{name}.toml is missing"));
        let file = SHIPPED.get_file(format!("{name}.toml"));
        let text = file.and_then(|file| file.contents_utf8()).ok_or_else(missing)?;
        Self::of_toml(Path::new(name), text, config)
    }

    fn reference(&self) -> &'static Reference {
        self.reference.unwrap_or(&REFERENCES[0])
    }

    /// Returns the configuration with the settings of the scenario.
    fn configured(&self, config: &Config) -> Result<Config, Error> {
        let (defaults, mut config) = (Config::default(), config.clone());
        for (name, value) in &self.settings {
            let is_default = |key: &Key| key.get(&config) == key.get(&defaults);
            if Key::named(name)?.iter().all(is_default) {
                config.set(name, value)?;
            }
        }
        let turns = self.reference().mode != Mode::Torque;
        if self.shaft == Shaft::Free || turns && config.load.mode == LoadMode::Locked {
            config.load.mode = LoadMode::Free;
        }
        if self.shaft == Shaft::Free {
            config.load.torque_nm = None;
        }
        Ok(config)
    }

    /// Returns the parts for this total time in seconds, and the total time, s.
    fn stretched(&self, seconds: Option<f64>) -> (Vec<Part>, f64) {
        let whole: f64 = self.parts.iter().map(|part| part.seconds).sum();
        let stretch = seconds.filter(|_| !self.from_rows).map_or(1.0, |seconds| seconds / whole);
        let part = |part: &Part| {
            let (begin, seconds) = (part.begin * stretch, part.seconds * stretch);
            Part { begin, seconds, ..*part }
        };
        (self.parts.iter().map(part).collect(), seconds.unwrap_or(whole))
    }

    /// Returns the value of a column in the unit of the drive.
    fn scaled(&self, config: &Config, column: &str, value: f64) -> f64 {
        match column {
            "torque_current" => config.iq_a() * value,
            "load" => self.load_nm(config) * value,
            _ if !self.text.in_proportion => value,
            "torque_current_a" => config.amperes(value),
            "speed_rpm" | "load_rpm" => config.rpm(value),
            "load_nm" => config.newton_metres(value),
            _ => value,
        }
    }

    /// Returns the load, Nm, whose multiples the parts state.
    fn load_nm(&self, config: &Config) -> f64 {
        let own = || self.scaled(config, "load_nm", self.text.load_nm);
        config.load.torque_nm.unwrap_or_else(own)
    }

    /// Returns a text of the file, in which the keys in braces are replaced with their values.
    fn filled(&self, text: &str, config: &Config) -> String {
        let load = text.replace("{load_nm}", &format!("{:.2}", self.load_nm(config)));
        Key::all().fold(load, |text, key| {
            let place = format!("{{{}}}", key.name());
            if text.contains(&place) {
                text.replace(&place, &key.get(config).to_string())
            } else {
                text
            }
        })
    }

    fn load(&self, part: &Part, t: f64) -> Option<Load> {
        let value = part.at(part.load, t);
        match self.shaft {
            Shaft::AsSet => None,
            Shaft::Free => Some(Load::Free { torque: value }),
            Shaft::Held => Some(Load::Speed { speed: value * TAU / 60.0 }),
        }
    }

    /// Runs the scenario.
    ///
    /// # Errors
    /// If the configuration is refused, or the drive refuses a command or does not start.
    pub fn outcome(&self, context: &Context<'_>) -> Result<Outcome, Error> {
        let record = self.record(context)?;
        let mut outcome = Outcome::default();
        if let Some(fault) = &record.fault {
            let hint = if context.config.prepare.learn { "" } else { ", and had not learned" };
            outcome.remark(format!("The drive stopped itself with {fault}{hint}."));
            outcome.faults.push(fault.clone());
        }
        if let Some((t, value, taken)) = record.limited {
            let column = self.reference().column;
            outcome.remark(format!(
                "The drive limited {column} of {value} to {taken}, for the first time at {t:.3} s."
            ));
        }
        record.metrics(self, &mut outcome.metrics);
        outcome.steps = self.text.levels.then(|| record.levels());
        outcome.figures.push(record.figure(self, context.config));
        if record.config.drive.angle_source == AngleSource::Injection {
            outcome.remarks.extend(assumptions(context.config));
        }
        let filled = |text: &String| self.filled(text, context.config);
        outcome.remarks.extend(self.text.remarks.iter().map(filled));
        Ok(outcome)
    }
}
