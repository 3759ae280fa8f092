//! Angles, vectors and their frames.

pub mod angle;
pub mod frames;

/// `value` within ±`largest`.
pub(crate) fn limited(value: f32, largest: f32) -> f32 {
    if value > largest {
        largest
    } else if value < -largest {
        -largest
    } else {
        value
    }
}
