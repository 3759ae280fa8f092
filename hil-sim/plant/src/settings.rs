//! Settings as tables: a row a setting.

/// A structure of settings, its defaults, and the check of the ranges. A row is `field: type = default, range, unit;`; one without a
/// range is checked elsewhere. `|s|` names the settings for ranges that depend on others.
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
            /// The default.
            pub const DEFAULT: Self = Self { $($field: $default,)+ };

            /// Refuses what is outside its range.
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

/// `range`, and 0 beside it.
pub(crate) fn or_zero(
    value: f64,
    range: std::ops::RangeInclusive<f64>,
) -> std::ops::RangeInclusive<f64> {
    if value == 0.0 { 0.0..=0.0 } else { range }
}
