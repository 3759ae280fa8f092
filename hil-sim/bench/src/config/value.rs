//! Values of configuration keys, their allowed ranges, and their conversion from text and TOML.

use std::fmt;

use serde::Serialize;

/// A value as the user wrote it, before a key has accepted it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number.
    Number(f64),
    /// `yes` or `no`; also `true` or `false`, as in TOML.
    Switch(bool),
    /// A word.
    Word(String),
    /// Not given; the documentation of the key states the value used instead.
    Unset,
}

impl Value {
    /// Converts the text after the equals sign on the command line.
    pub fn from_text(text: &str) -> Self {
        let text = text.trim();
        match (text.parse(), text) {
            (Ok(number), _) => Self::Number(number),
            (_, "true" | "yes") => Self::Switch(true),
            (_, "false" | "no") => Self::Switch(false),
            _ => Self::Word(text.to_owned()),
        }
    }

    /// Converts a TOML value; a date or an array becomes a word, which no key accepts.
    pub fn from_toml(value: &toml::Value) -> Self {
        match value {
            toml::Value::Float(number) => Self::Number(*number),
            toml::Value::Integer(number) => Self::Number(*number as f64),
            toml::Value::Boolean(on) => Self::Switch(*on),
            toml::Value::String(word) => Self::Word(word.clone()),
            other => Self::Word(other.to_string()),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Switch(on) => f.write_str(if *on { "yes" } else { "no" }),
            Self::Word(word) => f.write_str(word),
            Self::Unset => f.write_str("-"),
        }
    }
}

/// Converts single to double precision so that both have the same shortest decimal fraction.
pub fn double(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(number.into())
}

/// The allowed values of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// A number from `min` to `max`, both included.
    Range {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// One of these words.
    Words(&'static [&'static str]),
    /// `yes` or `no`.
    Switch,
}

/// A type that a field of the configuration can have.
pub trait Field: Sized {
    /// Returns the value as text or TOML would give it.
    fn to_value(&self) -> Value;
    /// Converts a value.
    ///
    /// # Errors
    /// The reason why the value is not allowed.
    fn from_value(value: &Value, allowed: &Allowed) -> Result<Self, &'static str>;
}

impl Field for f64 {
    fn to_value(&self) -> Value {
        Value::Number(*self)
    }
    fn from_value(value: &Value, allowed: &Allowed) -> Result<Self, &'static str> {
        match (value, allowed) {
            (Value::Number(number), _) if !number.is_finite() => Err("not a finite number"),
            (Value::Number(number), Allowed::Range { min, max }) => {
                if (min..=max).contains(&number) { Ok(*number) } else { Err("out of range") }
            }
            _ => Err("not a number"),
        }
    }
}

impl Field for u32 {
    fn to_value(&self) -> Value {
        Value::Number(f64::from(*self))
    }
    fn from_value(value: &Value, allowed: &Allowed) -> Result<Self, &'static str> {
        let number = f64::from_value(value, allowed)?;
        if number.fract() == 0.0 { Ok(number as u32) } else { Err("not a whole number") }
    }
}

impl Field for bool {
    fn to_value(&self) -> Value {
        Value::Switch(*self)
    }
    fn from_value(value: &Value, _: &Allowed) -> Result<Self, &'static str> {
        match value {
            Value::Switch(on) => Ok(*on),
            _ => Err("neither yes nor no"),
        }
    }
}

impl<T: Field> Field for Option<T> {
    fn to_value(&self) -> Value {
        self.as_ref().map_or(Value::Unset, Field::to_value)
    }
    fn from_value(value: &Value, allowed: &Allowed) -> Result<Self, &'static str> {
        match value {
            Value::Unset => Ok(None),
            _ => T::from_value(value, allowed).map(Some),
        }
    }
}
