//! The passport of a motor: a JSON file that says what was measured of it, and loads as a motor.

use serde::{Deserialize, Serialize};

use crate::error::{cut, parser_text};

/// Version of the file.
pub const SCHEMA: u32 = 1;
/// Keys that the twin of a learned motor needs beside those of a motor file.
const OF_LEARNED: &str =
    "saliency.a_psi saliency.psi_n saliency.b1 inverter.residual_v measurement.range_a";

/// A passport.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Passport {
    /// Version of the file.
    pub schema: u32,
    /// Program, image and build that measured it; for a trace its file.
    pub image: String,
    /// The measured values, in the order of the steps.
    pub measured: Vec<Measured>,
    /// Torque current, A; reference; slope, 1/rad, and carrier current, null where they are not learned. Empty: of a trace.
    pub over_torque_current: Vec<[Option<f64>; 4]>,
    /// The motor on the bench, its inverter and its sensors, as keys of the simulator.
    pub twin: toml::Table,
}

/// A value that was measured.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Step of the commissioning; `learned`; `trace`.
    pub step: String,
    /// Its name.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Its standard deviation; 0 where none is stated.
    pub deviation: f64,
    /// Its unit.
    pub unit: String,
}

impl Passport {
    /// Reads a text.
    ///
    /// # Errors
    /// The field that is missing, unknown or no number, with its line; another schema.
    pub fn parse(text: &str) -> Result<Self, String> {
        let named = |why: serde_json::Error| {
            let line = text.lines().nth(why.line().saturating_sub(1)).unwrap_or_default().trim();
            format!("{}: `{}`", parser_text(why), cut(line))
        };
        let any: serde_json::Value = serde_json::from_str(text).map_err(named)?;
        // Null, if it is no object.
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
