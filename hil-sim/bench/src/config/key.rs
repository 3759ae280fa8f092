//! A key of the bench or of the drive.

use std::collections::BTreeMap;

use drive_settings::entry::Entry;
use drive_settings::value::{AUTO, ValueError, Words as _};
use drive_settings::{SETTINGS, Settings, find};

use super::{BENCH, Config, DRIVE, PlantModel, Value};
use crate::error::Error;

/// A row of the table of the bench.
pub type BenchKey = Entry<Config, f64>;
/// Prefix of the keys that take effect after the saliency self-commissioning.
const AFTER: &str = "after.";

/// A key of the bench or of the drive.
#[derive(Clone, Copy)]
pub enum Key {
    /// A key of the bench.
    Bench(&'static BenchKey),
    /// A setting of the drive.
    Drive(&'static Entry<Settings>),
    /// A key of the plant with its value after the saliency self-commissioning.
    After(&'static BenchKey),
}

/// Evaluates an expression with the row of a key, whichever table it stands in.
macro_rules! of_row {
    ($key:expr, $entry:ident => $value:expr) => {
        match $key {
            Key::Bench($entry) | Key::After($entry) => $value,
            Key::Drive($entry) => $value,
        }
    };
}

fn on_bench(name: &str) -> Option<&'static BenchKey> {
    BENCH.iter().find(|key| key.name == name)
}

impl Key {
    /// Returns all keys of both tables, the bench's first.
    pub fn all() -> impl Iterator<Item = Self> {
        BENCH.iter().map(Self::Bench).chain(SETTINGS.iter().map(Self::Drive))
    }

    /// Returns the keys of the plant with their values after the saliency self-commissioning.
    pub fn after() -> impl Iterator<Item = Self> {
        let is_of_plant = |key: &&BenchKey| PLANT.iter().any(|group| key.name.starts_with(group));
        BENCH.iter().filter(is_of_plant).map(Self::After)
    }

    /// Returns the keys that an assignment to `name` sets, one or two.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the most similar name.
    pub fn named(name: &str) -> Result<Vec<Self>, Error> {
        let keys: Vec<_> = if let Some(name) = name.strip_prefix(AFTER) {
            Self::after().filter(|key| key.name() == name).collect()
        } else {
            let bare = name.strip_prefix(DRIVE);
            let bench = on_bench(name).filter(|_| bare.is_none()).map(Self::Bench);
            bench.into_iter().chain(find(bare.unwrap_or(name)).map(Self::Drive)).collect()
        };
        if keys.is_empty() {
            let known: Vec<_> = Self::all()
                .map(|key| key.name().to_owned())
                .chain(Self::after().map(Self::assigned_name))
                .collect();
            return Err(Error::unknown("key", name, known.iter().map(String::as_str)));
        }
        Ok(keys)
    }

    /// Returns the name in the key's own table.
    pub fn name(self) -> &'static str {
        of_row!(self, entry => entry.name)
    }

    /// Returns the name under which an assignment sets this key, alone or together with the bench's key of the same name.
    pub fn assigned_name(self) -> String {
        match self {
            Self::Drive(entry) if on_bench(entry.name).is_some() => {
                format!("{DRIVE}{}", entry.name)
            }
            Self::After(entry) => format!("{AFTER}{}", entry.name),
            _ => self.name().to_owned(),
        }
    }

    /// Returns the unit, empty for a pure number.
    pub fn unit(self) -> &'static str {
        of_row!(self, entry => entry.unit)
    }

    /// Returns the meaning.
    pub fn help(self) -> &'static str {
        of_row!(self, entry => entry.help).trim().trim_end_matches('.')
    }

    /// Returns the range of a number. The drive's values are checked together with its other settings when it is built; the range returned
    /// here holds with the defaults.
    pub fn range(self) -> Option<(f64, f64)> {
        match self {
            Self::Bench(entry) | Self::After(entry) => entry.range(&Config::default()),
            Self::Drive(entry) => {
                entry.range(&Settings::default()).map(|(min, max)| (double(min), double(max)))
            }
        }
    }

    /// Returns the words that may be set; none for a number.
    pub fn words(self) -> &'static [&'static str] {
        of_row!(self, entry => entry.words())
    }

    /// Returns the allowed values in words, with the unit.
    pub fn allowed_text(self) -> String {
        let Some((min, max)) = self.range() else { return self.words().join(", ") };
        let range = format!("{min} to {max} {}", self.unit());
        let auto = if of_row!(self, entry => entry.has_rule()) { ", or auto" } else { "" };
        format!("{}{auto}", range.trim_end())
    }

    /// Reads the value.
    pub fn get(self, config: &Config) -> Value {
        match self {
            Self::Bench(entry) => entry.get(config),
            Self::After(entry) => config.after.get(entry.name).copied().unwrap_or(Value::Auto),
            Self::Drive(entry) => match entry.get(&config.drive) {
                drive_settings::value::Value::Number(value) => Value::Number(double(value)),
                drive_settings::value::Value::Auto => Value::Auto,
                drive_settings::value::Value::Whole(value) => Value::Whole(value),
                drive_settings::value::Value::Word(word) => Value::Word(word),
            },
        }
    }

    /// Reads a number; none for a word, and for a number that is not set.
    pub fn number(self, config: &Config) -> Option<f64> {
        match self.get(config) {
            Value::Number(number) => Some(number),
            Value::Whole(number) => Some(number.into()),
            Value::Auto | Value::Word(_) => None,
        }
    }

    /// Sets the value that a text stands for. A word may stand in quotation marks.
    ///
    /// # Errors
    /// The reason why the value is not allowed.
    pub fn set(self, config: &mut Config, text: &str) -> Result<(), &'static str> {
        let text = if self.words().is_empty() { text } else { text.trim_matches('"') };
        match self {
            Self::Bench(entry) => set_on_bench(entry, config, text),
            Self::After(entry) if text == AUTO => {
                config.after.remove(entry.name);
                Ok(())
            }
            Self::After(entry) => {
                let mut checked = config.clone();
                set_on_bench(entry, &mut checked, text)?;
                config.after.insert(entry.name, entry.get(&checked));
                Ok(())
            }
            Self::Drive(entry) => {
                entry.set(&mut config.drive, entry.parse(text).map_err(reason)?);
                Ok(())
            }
        }
    }
}

/// Sets a value of the bench, and checks that it is in its range.
fn set_on_bench(entry: &BenchKey, config: &mut Config, text: &str) -> Result<(), &'static str> {
    let value = entry.parse(text).map_err(reason)?;
    entry.set(config, value);
    let is_within = |(min, max)| entry.number(config).is_some_and(|it| (min..=max).contains(&it));
    let is_allowed = value == Value::Auto || entry.range(config).is_none_or(is_within);
    if is_allowed { Ok(()) } else { Err("out of range") }
}

fn reason(error: ValueError) -> &'static str {
    match error {
        ValueError::Number => "not a number",
        ValueError::NumberOrAuto => "neither a number nor auto",
        ValueError::Whole(_) => "not a whole number in the range",
        ValueError::Word(_) => "not one of the words",
    }
}

/// Converts single to double precision so that both have the same shortest decimal fraction.
pub fn double(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(number.into())
}

/// Groups of the keys of the plant that may change after the saliency self-commissioning; the model and its flux level
/// stay.
const PLANT: [&str; 8] =
    ["motor.", "saliency.", "iron.", "warming.", "inverter.", "dc_link.", "measurement.", "shaft."];

/// Refuses keys that have no effect with the chosen machine model.
///
/// # Errors
/// [`Error::Refused`] with the first such key.
pub fn check_model(config: &Config) -> Result<(), Error> {
    let is_a = config.model.plant == PlantModel::A;
    let (other, remedy) =
        if is_a { ("iron.", "--plant linear or a family") } else { ("saliency.", "--plant a") };
    let default = Config::default();
    let idle = Key::all().find(|key| {
        let name = key.name();
        (name.starts_with(other) || is_a && name == "flux_level")
            && key.get(config) != key.get(&default)
    });
    idle.map_or(Ok(()), |key| {
        let (key, value, plant) = (key.name(), key.get(config), config.model.plant.word());
        let why = format!("plant = {plant} does not use it; it acts with {remedy}");
        Err(Error::Refused(format!("{key} = {value}: {why}")))
    })
}

impl Config {
    /// Returns the configuration after the saliency self-commissioning: the bench has changed, the drive has not.
    ///
    /// # Errors
    /// As [`check_model`].
    pub fn after_learning(&self) -> Result<Self, Error> {
        let mut config = Self { after: BTreeMap::new(), ..self.clone() };
        for entry in BENCH {
            if let Some(value) = self.after.get(entry.name) {
                entry.set(&mut config, *value);
            }
        }
        check_model(&config)?;
        Ok(config)
    }
}
