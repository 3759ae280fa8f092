//! The errors of settings that the plant refuses.

use std::ops::RangeInclusive;

/// A setting that the plant refuses: its value is outside the range, or not a number.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {value} is outside the allowed range {min} to {max} {unit}{}", reached(.saliency))]
pub struct PlantError {
    /// Name of the setting, for example `saliency.b1`.
    pub key: &'static str,
    /// The given value.
    pub value: f64,
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Unit of the three values.
    pub unit: &'static str,
    /// Magnitude that the saliency vector would reach, if it could grow beyond 0.5, towards the singularity at 1; see
    /// [`Machine::new`](super::Machine::new). Then the setting is the one that contributes most, and the range is what
    /// the present other saliency settings leave.
    pub saliency: Option<f64>,
}

fn reached(saliency: &Option<f64>) -> String {
    let text =
        |s| format!(": with the other saliency settings |s| would reach {s:.3}, more than 0.5");
    saliency.map(text).unwrap_or_default()
}

/// Refuses a value that is not finite or not in `range`.
pub(crate) fn check(
    key: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    unit: &'static str,
) -> Result<(), PlantError> {
    if range.contains(&value) {
        return Ok(());
    }
    let (min, max) = (*range.start(), *range.end());
    Err(PlantError { key, value, min, max, unit, saliency: None })
}
