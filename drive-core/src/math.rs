//! Angles, vectors with their reference frames, and decimal output.

/// Implements sum, difference and negative of a type, field by field. It replaces a crate of derive macros, which with its parser
/// would be compiled before the control, for which everything else waits.
macro_rules! field_by_field {
    ($name:ident { $($field:tt),+ }) => {
        impl core::ops::Add for $name {
            type Output = Self;
            #[inline]
            fn add(self, other: Self) -> Self {
                Self { $($field: self.$field + other.$field),+ }
            }
        }

        impl core::ops::Sub for $name {
            type Output = Self;
            #[inline]
            fn sub(self, other: Self) -> Self {
                Self { $($field: self.$field - other.$field),+ }
            }
        }

        impl core::ops::Neg for $name {
            type Output = Self;
            #[inline]
            fn neg(self) -> Self {
                Self { $($field: -self.$field),+ }
            }
        }

        impl core::ops::AddAssign for $name {
            #[inline]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }

        impl core::ops::SubAssign for $name {
            #[inline]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    };
}
use field_by_field;

pub(crate) mod angle;
pub(crate) mod frames;

/// Whether all values are finite numbers.
pub(crate) fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Returns `value` clamped to a range; NaN stays NaN.
pub fn within(value: f32, (least, most): (f32, f32)) -> f32 {
    if value > most {
        most
    } else if value < least {
        least
    } else {
        value
    }
}

/// Returns `value` clamped to ±`largest`; NaN stays NaN.
pub fn limited(value: f32, largest: f32) -> f32 {
    if value > largest {
        largest
    } else if value < -largest {
        -largest
    } else {
        value
    }
}
