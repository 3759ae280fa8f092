//! Keys of the plant whose value changes after the learning: `after.KEY`.

use std::collections::BTreeMap;

use super::Value;

/// Values that keys of the plant have after the learning, by the name of the key; the others keep theirs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct After(BTreeMap<&'static str, Value>);

impl After {
    /// The value of a key; [`Value::Unset`] where it keeps that of the learning.
    pub fn get(&self, name: &str) -> Value {
        self.0.get(name).cloned().unwrap_or(Value::Unset)
    }

    /// Sets the value of a key; [`Value::Unset`] keeps that of the learning.
    pub fn set(&mut self, name: &'static str, value: Value) {
        match value {
            Value::Unset => self.0.remove(name),
            value => self.0.insert(name, value),
        };
    }
}
