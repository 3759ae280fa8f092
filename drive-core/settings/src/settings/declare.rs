//! Declaration of settings. One row declares the field with its default and documentation, the row of
//! [`SETTINGS`](super::SETTINGS), and the rule that gives the value unless it is set.

/// Declares structures of settings and the table of all their rows. The rows of a structure of the control come first, as `=> [..];`.
/// A structure is
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
/// field: Type = default, NUMBER: kind("unit", rule: |settings| value).range(..).flags();
///
/// /// Documentation of a field that is no setting itself.
/// field: Type = default => [
///     /// The help text of a setting inside of it, or of another that stands here in the list.
///     "name" [path from `Settings`] field: Type, NUMBER: kind("unit", |settings| value in effect).range(..).flags();
/// ];
/// ```
///
/// NUMBER never changes: a new setting takes the next number of `tests/numbers.txt`, wherever its row stands. The kinds are
/// those of `entry!`. A pure number, a word and a whole number have no unit. Only `auto` has a rule, which becomes the function
/// `Settings::rule`: it returns the value that was set or, if none was, the value of the rule.
macro_rules! settings {
    (=> [$(
        #[doc = $first_help:literal]
        $first_name:literal $first_path:tt $first_field:ident: $first_type:ty, $first_id:literal: $first_kind:ident($($first_argument:expr),*)
        $(.$first_method:ident($($first_value:expr),*))*;
    )+];
    $(
        $(#[doc = $about:literal])+
        $group:ident $prefix:literal $path:tt {
            $(
                #[doc = $help:literal]
                $(#[doc = $more:literal])*
                $field:ident: $type:ty = $default:expr
                $(, $id:literal: $kind:ident($($unit:literal $(, $rule:ident: $value:expr)?)?) $(.$method:ident($($argument:expr),*))*)?
                $(=> [$(
                    #[doc = $row_help:literal]
                    $row_name:literal $row_path:tt $row_field:ident: $row_type:ty, $row_id:literal: $row_kind:ident($($row_argument:expr),*)
                    $(.$row_method:ident($($row_value:expr),*))*;
                )+])?;
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
        pub static SETTINGS: &[Entry<Settings>] = &[$(entry!(
            $first_id: $first_kind($($first_argument),*), $first_name, $first_path $first_field: $first_type, $first_help.trim_ascii()
        )$(.$first_method($($first_value),*))*,)+ $($(
            $(entry!(
                $id: $kind($($unit $(, Settings::$rule)?)?), concat!($prefix, stringify!($field)), $path $field: $type, $help.trim_ascii()
            )$(.$method($($argument),*))*,)?
            $($(entry!(
                $row_id: $row_kind($($row_argument),*), $row_name, $row_path $row_field: $row_type, $row_help.trim_ascii()
            )$(.$row_method($($row_value),*))*,)+)?
        )+)+];

        impl Settings {
            $($($($($(rule!(
                concat!("`", $prefix, stringify!($field), "` in effect:", $help, ". Unit: ", $unit, "."),
                $rule, $path $field, $value
            );)?)?)?)+)+
        }
    };
}

/// Declares the function that returns the value in effect of a field with a rule.
macro_rules! rule {
    ($doc:expr, $rule:ident, [$($path:ident).*] $field:ident, $value:expr) => {
        #[doc = $doc]
        pub fn $rule(&self) -> f32 {
            or_rule(self, self.$($path.)*$field, $value)
        }
    };
}

pub(super) use {rule, settings};
