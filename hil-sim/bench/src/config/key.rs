//! A key of the bench or of the drive.

use std::collections::BTreeMap;

use drive_settings::entry::Entry;
use drive_settings::{SETTINGS, Settings, find, value as drive};

use super::value::{Field as _, double};
use super::{Allowed, BENCH, BenchKey, Config, DRIVE, PlantModel, Value};
use crate::error::Error;

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
        BENCH.iter().filter(|key| is_of_plant(key)).map(Self::After)
    }

    /// Returns the keys that an assignment to `name` sets, one or two.
    ///
    /// # Errors
    /// [`Error::Unknown`] with the most similar name.
    pub fn named(name: &str) -> Result<Vec<Self>, Error> {
        if let Some(key) = Self::after().find(|key| key.name() == name) {
            return Ok(vec![key]);
        }
        let (bench, drive) = match name.strip_prefix(DRIVE) {
            Some(name) => (None, find(name)),
            None => (on_bench(name), find(name)),
        };
        let keys: Vec<_> =
            bench.map(Self::Bench).into_iter().chain(drive.map(Self::Drive)).collect();
        if keys.is_empty() {
            let known = Self::all().chain(Self::after()).map(Self::name);
            return Err(Error::unknown("key", name, known));
        }
        Ok(keys)
    }

    /// Returns the name in the key's own table.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bench(key) => key.name,
            Self::Drive(entry) => entry.name,
            Self::After(key) => key.after,
        }
    }

    /// Returns the name under which an assignment sets this key, alone or together with the bench's key of the same name.
    pub fn assigned_name(self) -> String {
        match self {
            Self::Drive(entry) if on_bench(entry.name).is_some() => {
                format!("{DRIVE}{}", entry.name)
            }
            _ => self.name().to_owned(),
        }
    }

    /// Returns the unit, empty for a pure number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Bench(key) | Self::After(key) => key.unit,
            Self::Drive(entry) => entry.unit,
        }
    }

    /// Returns the meaning.
    pub fn help(self) -> &'static str {
        match self {
            Self::Bench(key) | Self::After(key) => key.doc.trim().trim_end_matches('.'),
            Self::Drive(entry) => entry.help,
        }
    }

    /// Returns the allowed values. The drive's values are checked together with its other settings when it is built;
    /// the range returned here holds with the defaults.
    pub fn allowed(self) -> Allowed {
        match self {
            Self::Bench(key) | Self::After(key) => key.allowed,
            Self::Drive(entry) => match entry.range(&Settings::default()) {
                Some((min, max)) => Allowed::Range { min: double(min), max: double(max) },
                None => Allowed::Words(entry.words()),
            },
        }
    }

    /// Returns the allowed values in words, with the unit.
    pub fn allowed_text(self) -> String {
        let has_rule = matches!(self, Self::Drive(entry) if entry.has_rule());
        let auto = if has_rule { ", or auto" } else { "" };
        match self.allowed() {
            Allowed::Range { min, max } => {
                let range = format!("{min} to {max} {}", self.unit());
                format!("{}{auto}", range.trim_end())
            }
            Allowed::Words(words) => words.join(", "),
            Allowed::Switch => "yes, no".to_owned(),
        }
    }

    /// Reads the value.
    pub fn get(self, config: &Config) -> Value {
        match self {
            Self::Bench(key) => (key.get)(config),
            Self::After(key) => config.after.get(key.name).cloned().unwrap_or(Value::Unset),
            Self::Drive(entry) => match entry.get(&config.drive) {
                drive::Value::Number(value) => Value::Number(double(value)),
                drive::Value::Whole(value) => Value::Number(value.into()),
                drive::Value::Word(word) => Value::Word(word.to_owned()),
                drive::Value::Auto => Value::Word(drive::AUTO.to_owned()),
            },
        }
    }

    /// Sets the value.
    ///
    /// # Errors
    /// The reason why the value is not allowed.
    pub fn set(self, config: &mut Config, value: &Value) -> Result<(), &'static str> {
        match self {
            Self::Bench(key) => (key.set)(config, value),
            Self::After(key) => set_after(config, key, value),
            Self::Drive(entry) => {
                let value = entry.parse(&value.to_string()).map_err(reason)?;
                entry.set(&mut config.drive, value);
                Ok(())
            }
        }
    }
}

fn reason(error: drive::ValueError) -> &'static str {
    match error {
        drive::ValueError::Number => "not a finite number",
        drive::ValueError::NumberOrAuto => "neither a finite number nor auto",
        drive::ValueError::Whole(_) => "not a whole number in the range",
        drive::ValueError::Word(_) => "not one of the words",
    }
}

/// Groups of the keys of the plant that may change; the model and its flux level stay.
const PLANT: [&str; 8] =
    ["motor.", "saliency.", "iron.", "warming.", "inverter.", "dc_link.", "measurement.", "shaft."];

/// Whether a key belongs to the plant and may change after the saliency self-commissioning.
fn is_of_plant(key: &BenchKey) -> bool {
    PLANT.iter().any(|group| key.name.starts_with(group))
}

/// Sets the value that a key has after the saliency self-commissioning, within the usual range of the key.
fn set_after(config: &mut Config, key: &BenchKey, value: &Value) -> Result<(), &'static str> {
    if *value == Value::Unset {
        config.after.remove(key.name);
        return Ok(());
    }
    let mut checked = config.clone();
    (key.set)(&mut checked, value)?;
    config.after.insert(key.name, (key.get)(&checked));
    Ok(())
}

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
        let (key, value, plant) = (key.name(), key.get(config), config.model.plant.to_value());
        let why = format!("plant = {plant} does not use it; it acts with {remedy}");
        Err(Error::Refused(format!("{key} = {value}: {why}")))
    })
}

impl Config {
    /// Returns the configuration after the saliency self-commissioning: the bench has changed, the drive has not.
    ///
    /// # Errors
    /// [`Error::Refused`] with the reason why a value is not allowed, or as [`check_model`].
    pub fn after_learning(&self) -> Result<Self, Error> {
        let mut config = Self { after: BTreeMap::new(), ..self.clone() };
        for key in BENCH {
            if let Some(value) = self.after.get(key.name) {
                (key.set)(&mut config, value).map_err(Error::refused)?;
            }
        }
        check_model(&config)?;
        Ok(config)
    }
}
