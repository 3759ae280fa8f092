//! Angles, vectors with their reference frames, and decimal output.

pub(crate) mod angle;
pub(crate) mod frames;

/// Whether all values are finite numbers.
pub fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// `value` clamped to a range; NaN stays NaN.
pub fn within(value: f32, (least, most): (f32, f32)) -> f32 {
    if value > most {
        most
    } else if value < least {
        least
    } else {
        value
    }
}

/// `value` clamped to ±`largest`; NaN stays NaN.
pub fn limited(value: f32, largest: f32) -> f32 {
    if value > largest {
        largest
    } else if value < -largest {
        -largest
    } else {
        value
    }
}
