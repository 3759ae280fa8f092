//! Settings as a host stores them, with the feature `serde`: a map from the names of the settings that were set to their values,
//! with the names and words of the console. Settings that a map does not name have their defaults. Learned tables are not settings
//! and not in the map.

extern crate alloc;

use alloc::{collections::BTreeMap, string::String, string::ToString as _};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error as _};

use super::{SETTINGS, Settings, find, value::Value};

/// A value in a map.
#[derive(Deserialize)]
#[serde(untagged)]
enum Given {
    Number(f32),
    Word(String),
}

impl Serialize for Settings {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let rows = SETTINGS.iter().map(|entry| (entry.name, entry.get(self)));
        to.collect_map(rows.filter(|(_, value)| *value != Value::Auto))
    }
}

impl<'de> Deserialize<'de> for Settings {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let mut settings = Self::DEFAULT;
        for (name, given) in BTreeMap::<String, Given>::deserialize(from)? {
            let text = match given {
                Given::Number(number) => number.to_string(),
                Given::Word(word) => word,
            };
            let refused = |why| D::Error::custom(format_args!("{name} = {text}: {why}"));
            let entry = find(&name).ok_or_else(|| refused("no such setting".to_string()))?;
            let value = entry.parse(&text).map_err(|why| refused(why.to_string()))?;
            entry.set(&mut settings, value);
        }
        Ok(settings)
    }
}
