//! Keys of the plant whose value changes after the learning: `after.KEY`.

use std::collections::BTreeMap;

use super::{BENCH, BenchKey, Config, Value};

/// Groups of the keys of the plant; the model and its flux level stay.
const PLANT: [&str; 8] =
    ["motor.", "saliency.", "iron.", "warming.", "inverter.", "dc_link.", "measurement.", "shaft."];

/// Whether a key is one of the plant.
pub fn is_of_plant(key: &BenchKey) -> bool {
    PLANT.iter().any(|group| key.name.starts_with(group))
}

/// Values that keys of the plant have after the learning, by the name of the key; the others keep theirs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct After(BTreeMap<&'static str, Value>);

impl After {
    /// The value of a key; [`Value::Unset`] where it keeps that of the learning.
    pub fn get(&self, key: &BenchKey) -> Value {
        self.0.get(key.name).cloned().unwrap_or(Value::Unset)
    }

    /// Sets a key to what it is after the learning, within the range that it always has.
    ///
    /// # Errors
    /// The reason why the value is not allowed.
    pub fn set(config: &mut Config, key: &BenchKey, value: &Value) -> Result<(), &'static str> {
        if *value == Value::Unset {
            config.after.0.remove(key.name);
            return Ok(());
        }
        let mut checked = config.clone();
        (key.set)(&mut checked, value)?;
        config.after.0.insert(key.name, (key.get)(&checked));
        Ok(())
    }
}

impl Config {
    /// The configuration after the learning: the bench has changed, the drive has not.
    ///
    /// # Errors
    /// The reason why a value is not allowed; those that [`After::set`] has taken are.
    pub fn after_learning(&self) -> Result<Self, &'static str> {
        let mut config = Self { after: After::default(), ..self.clone() };
        for key in BENCH {
            if let Some(value) = self.after.0.get(key.name) {
                (key.set)(&mut config, value)?;
            }
        }
        Ok(config)
    }
}
