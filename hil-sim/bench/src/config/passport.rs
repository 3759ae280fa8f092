//! The passport of a motor: a JSON file with the values measured on it, which loads as a motor.

use serde::{Deserialize, Serialize};

use crate::error::{cut, parser_text};

/// Version of the file.
pub const SCHEMA: u32 = 1;
/// Keys that the simulation model of a motor with a saliency self-commissioning needs besides those of a motor file.
const OF_LEARNED: &str =
    "saliency.a_psi saliency.psi_n saliency.b1 inverter.residual_v measurement.range_a";

/// A passport.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Passport {
    /// Version of the file.
    pub schema: u32,
    /// Program, image and build that measured the motor; for a trace, the name of its file.
    pub image: String,
    /// The measured values, in the order of the steps.
    pub measured: Vec<Measured>,
    /// Rows of: q-axis current, A; saliency offset; saliency sensitivity, 1/rad; injection current, A. Values that were
    /// not learned are null. Empty for a trace.
    pub over_torque_current: Vec<[Option<f64>; 4]>,
    /// Simulation model of the motor, its inverter and its sensors, as keys of the simulator.
    pub twin: toml::Table,
}

/// A measured value.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Step of the commissioning, or `learned`, or `trace`.
    pub step: String,
    /// Name of the value.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Standard deviation of the value; 0 if none is stated.
    pub deviation: f64,
    /// Unit of the value.
    pub unit: String,
}

impl Passport {
    /// Parses a passport.
    ///
    /// # Errors
    /// Names the field that is missing, unknown or not a number, with its line; or the schema, if it is another one.
    pub fn parse(text: &str) -> Result<Self, String> {
        let named = |why: serde_json::Error| {
            let line = text.lines().nth(why.line().saturating_sub(1)).unwrap_or_default().trim();
            format!("{}: `{}`", parser_text(why), cut(line))
        };
        let any: serde_json::Value = serde_json::from_str(text).map_err(named)?;
        // An index into anything but an object gives null.
        if any["schema"] != SCHEMA {
            let schema = cut(&any["schema"].to_string());
            return Err(format!("schema = {schema}; allowed: {SCHEMA}"));
        }
        let passport: Self = serde_json::from_str(text).map_err(named)?;
        let missing = OF_LEARNED.split(' ').find(|key| !passport.twin.contains_key(*key));
        match missing.filter(|_| !passport.over_torque_current.is_empty()) {
            Some(key) => Err(format!("twin: missing field `{key}`")),
            None => Ok(passport),
        }
    }
}
