//! Values of settings and their text form.

use core::fmt;

use lexical_parse_float::FromLexical;

/// A number of a table of settings: `f32` in the drive, `f64` on the bench of the simulator.
pub trait Real: FromLexical + PartialOrd + Copy + 'static {
    /// Whether it is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// Converts a whole number.
    fn of_whole(whole: u32) -> Self;
    /// Converts to a whole number; a fraction is cut off.
    fn to_whole(self) -> u32;
}

macro_rules! real {
    ($($type:ident)+) => {$(
        impl Real for $type {
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            fn of_whole(whole: u32) -> Self {
                whole as Self
            }
            fn to_whole(self) -> u32 {
                self as u32
            }
        }
    )+};
}
real!(f32 f64);

/// A value of a setting.
///
/// Exhaustive on purpose: every kind of value has to be stored and shown.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
pub enum Value<N = f32> {
    /// A finite number.
    Number(N),
    /// The number that the rule of the setting gives; see [`rules`](super::rules).
    Auto,
    /// A whole number.
    Whole(u32),
    /// One of the setting's words.
    Word(&'static str),
}

impl<N: fmt::Display> fmt::Display for Value<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) => value.fmt(f),
            Self::Auto => f.write_str(AUTO),
            Self::Whole(value) => value.fmt(f),
            Self::Word(word) => f.write_str(word),
        }
    }
}

/// Text of [`Value::Auto`].
pub const AUTO: &str = "auto";

/// Reason why a text is not a value of a setting.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// Not a finite number.
    #[error("not a number")]
    Number,
    /// Neither a finite number nor `auto`.
    #[error("neither a number nor `{AUTO}`")]
    NumberOrAuto,
    /// Not a whole number up to this one.
    #[error("not a whole number from 0 to {0}")]
    Whole(u32),
    /// Not one of these words.
    #[error("not one of:{}", fmt::from_fn(|f| .0.iter().try_for_each(|word| write!(f, " {word}"))))]
    Word(&'static [&'static str]),
}

/// Returns the finite number that a text stands for: digits with optional sign, point and power of ten (`-0.5`, `1e-3`).
pub fn number<N: Real>(text: &str) -> Option<N> {
    N::from_lexical(text.as_bytes()).ok().filter(|value| value.is_finite())
}

/// A type whose values are written as words.
pub trait Words: Copy + PartialEq + 'static {
    /// The words.
    const WORDS: &'static [&'static str];
    /// The values, in the order of their words.
    const VALUES: &'static [Self];

    /// Returns the position of this value among the words.
    fn place(self) -> usize {
        Self::VALUES.iter().position(|value| *value == self).unwrap_or(0)
    }

    /// Returns the value at a position; the first value if the position is too large.
    fn at(place: usize) -> Self {
        Self::VALUES.get(place).copied().unwrap_or(Self::VALUES[0])
    }

    /// Returns the word of this value.
    fn word(self) -> &'static str {
        Self::WORDS[self.place()]
    }
}

/// Declares enumerations and their [`Words`], which must be in scope; or the words of an enumeration that is declared elsewhere.
#[doc(hidden)]
#[macro_export]
macro_rules! words {
    ($($(#[$about:meta])* pub enum $type:ident { $($(#[$more:meta])* $variant:ident = $word:literal,)+ })+) => {$(
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $type { $($(#[$more])* $variant,)+ }

        $crate::words!($type { $($variant = $word,)+ });
    )+};
    ($type:ident { $($variant:ident = $word:literal,)+ }) => {
        impl Words for $type {
            const WORDS: &'static [&'static str] = &[$($word),+];
            const VALUES: &'static [Self] = &[$(Self::$variant),+];
        }

        // Fails to compile if a variant is missing.
        const _: fn($type) = |value| match value { $($type::$variant => {})+ };
    };
}
pub(crate) use crate::words;

impl Words for bool {
    const WORDS: &'static [&'static str] = &["no", "yes"];
    const VALUES: &'static [Self] = &[false, true];
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn only_finite_numbers_are_taken() {
        let refused = [
            "", ".", "-", "e5", "1e", "1e300", "1e99999", "1,5", "1A", "1 ", "0x1", "nan", "NaN",
            "inf", "-inf", "infinity",
        ];
        for text in refused {
            assert_eq!(number::<f32>(text), None, "{text}");
        }
        for (text, value) in
            [("000000000000000000000000001.5", 1.5), ("+.5", 0.5), ("-2e-3", -2e-3)]
        {
            assert_eq!(number(text), Some(value));
        }
    }

    proptest! {
        #[test]
        fn what_is_printed_is_read_back(bits: u32) {
            let value = f32::from_bits(bits);
            prop_assume!(value.is_finite());
            prop_assert_eq!(number(&Value::Number(value).to_string()), Some(value));
            prop_assert_eq!(number(&format!("{value:e}")), Some(value));
        }
    }
}
