//! Settings as tables, with one row for each setting.

/// Defines a structure of settings, its defaults, and the check of the ranges. A row is `field: type = default, range,
/// unit;`. A row without a range is checked elsewhere. `|s|` names the settings for ranges that depend on other
/// settings.
macro_rules! settings {
    ($(#[$doc:meta])* $name:ident $group:literal $(|$s:ident|)? {
        $($(#[$field_doc:meta])* $field:ident: $type:ty = $default:expr $(, $range:expr, $unit:literal)?;)+
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $type,)+
        }

        impl $name {
            /// The default settings.
            pub const DEFAULT: Self = Self { $($field: $default,)+ };

            /// Refuses values outside their range.
            pub(crate) fn check(&self) -> Result<(), $crate::PlantError> {
                $(let $s = self;)?
                $($($crate::error::check(
                    concat!($group, stringify!($field)), f64::from(self.$field), $range, $unit,
                )?;)?)+
                Ok(())
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::DEFAULT
            }
        }
    };
}
pub(crate) use settings;

/// Returns the allowed range: only 0 if the value is 0, otherwise `range`.
pub(crate) fn or_zero(
    value: f64,
    range: std::ops::RangeInclusive<f64>,
) -> std::ops::RangeInclusive<f64> {
    if value == 0.0 { 0.0..=0.0 } else { range }
}
