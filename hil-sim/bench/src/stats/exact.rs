//! Numbers in JSON that are read back exactly. JSON cannot write a number that is not finite, so it becomes a text:
//! `NaN`, `inf` or `-inf`.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serializer};

/// Writes a number; for `#[serde(with)]`.
///
/// # Errors
/// The errors of the serializer.
pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.serialize_str(&value.to_string())
    }
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Number(f64),
    Text(String),
}

/// Reads a number; for `#[serde(with)]`.
///
/// # Errors
/// The errors of the deserializer, and a text that is not a number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    match Written::deserialize(deserializer)? {
        Written::Number(number) => Ok(number),
        Written::Text(text) => text.parse().map_err(D::Error::custom),
    }
}
