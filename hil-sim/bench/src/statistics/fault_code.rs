//! A fault, or none, as its number in JSON.

use drive_core::Fault;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Writes a fault; for `#[serde(with)]`.
///
/// # Errors
/// The errors of the serializer.
pub fn serialize<S: Serializer>(fault: &Option<Fault>, serializer: S) -> Result<S::Ok, S::Error> {
    fault.map(Fault::code).serialize(serializer)
}

/// Reads a fault; for `#[serde(with)]`.
///
/// # Errors
/// The errors of the deserializer, and a number that no fault has.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Fault>, D::Error> {
    let Some(code) = Option::<u8>::deserialize(deserializer)? else { return Ok(None) };
    let fault = Fault::ALL.iter().copied().find(|fault| fault.code() == code);
    fault.map(Some).ok_or_else(|| D::Error::custom(format!("no fault has the number {code}")))
}
