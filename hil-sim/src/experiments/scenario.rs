//! Runs over time: what the drive is asked for part by part, what turns its shaft, what is recorded and how it is judged.
//!
//! A scenario is a TOML file, or the rows of a CSV file, the experiment `profile`. `hil-sim/scenarios/` has the files of the program;
//! its `README.md` describes their keys.

mod file;
mod quantity;
mod record;

pub use file::{Metric, Statistic};
pub use quantity::{QUANTITIES, Seen};
pub use record::Record;

use self::file::{Ramp, Text};
use crate::prelude::*;

/// Experiments that are scenarios of the program, each with the name of its file, what it stands for, the keys that it uses,
/// those that it does not, and a sentence about it.
macro_rules! shipped {
    ($($place:ident $name:literal $stands_for:literal $uses:expr, $not:expr; $about:literal)+) => {$(
        #[doc = $about]
        pub const $place: Experiment = Experiment::new($name, |context| {
            const TEXT: &str = include_str!(concat!("../../scenarios/", $name, ".toml"));
            Scenario::of_toml(Path::new(concat!($name, ".toml")), TEXT, context.config)?.outcome(context)
        })
        .stands_for($stands_for)
        .about($about)
        .uses($uses)
        .not($not);
    )+};
}

shipped! {
    STEPS "torque-steps" "Figure 38, Eq. 4.4" &[BENCH, DRIVE, &["load.", "reference.iq_a", "prepare.learn", "seconds"]], &[SPEED_LOOP];
    "Torque steps with a locked shaft and no position sensor: five levels, 1 to 2 times `reference.iq_a`."
    RAMP "torque-ramp" "Figure 39, Eq. 4.4" STEPS.uses, STEPS.not;
    "Torque ramp with a locked shaft and no position sensor: `reference.iq_a` to twice that and back."
    REVERSAL "torque-reversal" "section 5.2" &[BENCH, DRIVE, &["load.", "prepare.learn", "seconds"]], STEPS.not;
    "Sudden steps of the torque current up to full reversal, without a position sensor."
    SPEED "speed-profile" "section 5.2" &[BENCH, DRIVE, &["load.torque_nm", "prepare.learn", "seconds"]], &[];
    "Speed steps with a reversal through standstill and a load, with the angle source as set."
    POSITION "position-step" "Figure 37, Eq. 4.1 to 4.3" &[BENCH, DRIVE, &["load.", "seconds"]], &[TRACKING, &["angle_source"]];
    "A position step of five turns with the encoder and a free shaft."
}

/// References and a load in rows.
pub const PROFILE: Experiment = Experiment::new("profile", |context| {
    super::check_file(&PROFILE, context.file)?;
    Scenario::of_csv(context.file.unwrap_or(Path::new("")), context.config)?.outcome(context)
})
.stands_for("a profile of the user")
.about("References and load over time from a CSV file: `run profile --input FILE.csv`.")
.uses(REVERSAL.uses);
/// A TOML file of the user.
const OWN: Experiment = Experiment::new("scenario", |context| {
    Scenario::read(context.file.unwrap_or(Path::new("")), context.config)?.outcome(context)
})
.stands_for("a scenario of the user")
.about("Parts, shaft, columns and judge of a TOML file.")
.uses(STEPS.uses);

/// The scenario that a TOML file is, with the name of the file; none for another name. The name lasts as long as the program.
pub fn own(name: &str) -> Option<Experiment> {
    let stem = Path::new(name.strip_suffix(".toml")?).file_name()?.to_string_lossy();
    Some(Experiment { name: stem.into_owned().leak(), ..OWN })
}

/// The step of five turns with an encoder, for the comparison with one without: the settings of the scenario count for the
/// encoder alone.
///
/// # Errors
/// As [`Scenario::record`].
pub fn position_step(context: &Context<'_>, encoder: bool, seconds: f64) -> Result<Record, Error> {
    let text = include_str!("../../scenarios/position-step.toml");
    let mut scenario = Scenario::of_toml(Path::new("position-step.toml"), text, context.config)?;
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

/// The three of which a run has one.
#[rustfmt::skip] // one a line
static REFERENCES: [Reference; 3] = [
    Reference { column: "torque_current_a", mode: Mode::Torque, command: Command::Torque, actual: |p| p.iq },
    Reference { column: "speed_rpm", mode: Mode::Speed, command: Command::Speed, actual: |p| p.speed_rpm },
    Reference { column: "position_turns", mode: Mode::Position, command: Command::Position, actual: |p| p.turns },
];

/// The shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Shaft {
    /// As the configuration says.
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
    /// Beginning and length, s; a step has no length.
    begin: f64,
    seconds: f64,
    reference: Ramp,
    /// Torque or speed of the shaft.
    load: Ramp,
    /// Given at the beginning.
    stop: Option<Stop>,
    start: bool,
}

impl Part {
    /// A value of the part at a time; the last one holds afterwards.
    fn at(&self, Ramp(from, to): Ramp, t: f64) -> f64 {
        let share = (t - self.begin) / self.seconds;
        if share < 1.0 { from + share * (to - from) } else { to }
    }
}

/// A scenario.
#[derive(Default)]
pub struct Scenario {
    /// A scenario that is read has one.
    reference: Option<&'static Reference>,
    shaft: Shaft,
    parts: Vec<Part>,
    /// Settings that hold where the configuration has the default.
    settings: Vec<(String, Value)>,
    /// Whether it comes from rows: `--seconds` cuts or holds it, instead of stretching it.
    from_rows: bool,
    /// Figures, metrics and judge.
    text: Text,
}

impl Scenario {
    fn reference(&self) -> &'static Reference {
        self.reference.unwrap_or(&REFERENCES[0])
    }

    /// The configuration with the settings of the scenario.
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

    /// The parts in a time of this many seconds, and the time of all, s.
    fn course(&self, seconds: Option<f64>) -> (Vec<Part>, f64) {
        let whole: f64 = self.parts.iter().map(|part| part.seconds).sum();
        let stretch = seconds.filter(|_| !self.from_rows).map_or(1.0, |seconds| seconds / whole);
        let stretched = |part: &Part| {
            let (begin, seconds) = (part.begin * stretch, part.seconds * stretch);
            Part { begin, seconds, ..*part }
        };
        (self.parts.iter().map(stretched).collect(), seconds.unwrap_or(whole))
    }

    /// The value of a column in the unit of the drive.
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

    /// The load whose multiples the parts give, Nm.
    fn load_nm(&self, config: &Config) -> f64 {
        let own = || self.scaled(config, "load_nm", self.text.load_nm);
        config.load.torque_nm.unwrap_or_else(own)
    }

    /// A text of the file with the values of the keys that it names in braces.
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

    /// Runs it.
    ///
    /// # Errors
    /// When the configuration is refused, or the drive refuses a command or does not start.
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
