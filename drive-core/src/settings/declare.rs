//! Declaration of settings: one row is the field with its default and documentation, the row of [`SETTINGS`](super::SETTINGS),
//! and the rule that gives the value unless it is set.

/// Declares structures of settings and the table of all their rows. A structure is
///
/// ```text
/// /// Documentation.
/// Name "prefix of the names of its settings" [path from `Settings` to it] { rows }
/// ```
///
/// A row is one of
///
/// ```text
/// /// The help text, in one line.
/// /// More documentation.
/// field: Type = default, kind("unit", rule: |settings| value).range(..).flags();
///
/// /// Documentation of a field that is no setting itself.
/// field: Type = default => [rows of the table, as the macros of `entry` make them];
/// ```
///
/// The kinds are the macros of [`entry`](super::entry): `number` and `auto` have a unit, `auto` has a rule. A rule becomes
/// `Settings::rule`: the value that was set or, if none was, that of the rule.
macro_rules! settings {
    ($(
        $(#[doc = $about:literal])+
        $group:ident $prefix:literal $path:tt {
            $(
                #[doc = $help:literal]
                $(#[doc = $more:literal])*
                $field:ident: $type:ty = $default:expr
                $(, $kind:ident($($unit:literal $(, $rule:ident: $value:expr)?)?) $(.$method:ident($($argument:expr),*))*)?
                $(=> [$($row:expr),+ $(,)?])?;
            )+
        }
    )+) => {
        $(
            $(#[doc = $about])+
            #[derive(Clone, Copy, Debug, PartialEq)]
            pub struct $group {
                $(
                    #[doc = $help]
                    $(#[doc = $more])*
                    $($(#[doc = concat!("\n\nUnit: ", $unit, ".")])?)?
                    pub $field: $type,
                )+
            }

            impl $group {
                /// The defaults.
                pub const DEFAULT: Self = Self { $($field: $default,)+ };
            }

            impl Default for $group {
                fn default() -> Self {
                    Self::DEFAULT
                }
            }
        )+

        /// The settings of the drive, in the order in which they are shown.
        pub static SETTINGS: &[Entry<Settings>] = &[$($(
            $(row!(
                $kind($($unit $(, $rule)?)?), concat!($prefix, stringify!($field)), $help.trim_ascii(), $path $field: $type
            )$(.$method($($argument),*))*,)?
            $($($row,)+)?
        )+)+];

        impl Settings {
            $($($($($(rule!(
                concat!("`", $prefix, stringify!($field), "` in effect:", $help, ". Unit: ", $unit, "."),
                $rule, $path $field, $value
            );)?)?)?)+)+
        }
    };
}

/// The row of the table for a field.
macro_rules! row {
    (number($unit:literal), $name:expr, $help:expr, [$($path:ident).*] $field:ident: $type:ty) => {
        number!($name, $($path.)*$field, $unit, $help)
    };
    (auto($unit:literal, $rule:ident), $name:expr, $help:expr, [$($path:ident).*] $field:ident: $type:ty) => {
        auto!($name, $($path.)*$field, Settings::$rule, $unit, $help)
    };
    (whole(), $name:expr, $help:expr, [$($path:ident).*] $field:ident: $type:ty) => {
        whole!($name, $($path.)*$field: $type, $help)
    };
    (word(), $name:expr, $help:expr, [$($path:ident).*] $field:ident: $type:ty) => {
        word!($name, $($path.)*$field: $type, $help)
    };
}

/// The function that gives the value in effect of a field with a rule.
macro_rules! rule {
    ($doc:expr, $rule:ident, [$($path:ident).*] $field:ident, $value:expr) => {
        #[doc = $doc]
        pub fn $rule(&self) -> f32 {
            or_rule(self, self.$($path.)*$field, $value)
        }
    };
}

pub(super) use {row, rule, settings};
