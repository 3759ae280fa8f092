//! The errors of settings that the plant refuses.

use std::ops::RangeInclusive;

/// A setting that the plant refuses.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// A value is outside its range or not a number.
    #[error("{key} = {value} is outside the allowed range {min} to {max} {unit}")]
    OutOfRange {
        /// Name of the setting, for example `saliency.b1`.
        key: &'static str,
        /// The given value.
        value: f64,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
        /// Unit of the three values.
        unit: &'static str,
    },
    /// The saliency vector could grow beyond 0.5, towards the singularity at 1; see
    /// [`Machine::new`](super::Machine::new).
    #[error(
        "{key} = {value} is outside the allowed range {min} to {max} {unit}: \
         with the other saliency settings |s| would reach {saliency:.3}, more than 0.5"
    )]
    TooSalient {
        /// Name of the setting that contributes most.
        key: &'static str,
        /// The given value.
        value: f64,
        /// Smallest allowed value with the present other saliency settings.
        min: f64,
        /// Largest allowed value with the present other saliency settings.
        max: f64,
        /// Unit of the three values.
        unit: &'static str,
        /// Magnitude that the saliency vector would reach.
        saliency: f64,
    },
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
    Err(PlantError::OutOfRange { key, value, min: *range.start(), max: *range.end(), unit })
}
