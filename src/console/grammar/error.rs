//! The reason why a line is invalid.

use core::fmt;

use drive_core::settings::value::ValueError;

use crate::link::trace::SIGNALS;
use crate::settings::keys::Key;

/// Reason why a line is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParseError<'a> {
    /// No such command.
    Command {
        /// The word.
        word: &'a str,
        /// A command that is spelt like it.
        near: Option<&'static str>,
    },
    /// This word is missing.
    Missing(&'static str),
    /// A word more than the command takes.
    TooMuch(&'a str),
    /// More of these than this number.
    TooMany {
        /// The things that are counted.
        what: &'static str,
        /// Their largest number.
        most: usize,
    },
    /// Not a finite number.
    Number {
        /// What it stands for, with its unit.
        what: &'static str,
        /// The word.
        word: &'a str,
    },
    /// Not one of these words.
    OneOf {
        /// What it stands for.
        what: &'static str,
        /// The word.
        word: &'a str,
        /// All that are allowed.
        all: &'static str,
    },
    /// Not a whole number in this range.
    Whole {
        /// What it stands for.
        what: &'static str,
        /// The word.
        word: &'a str,
        /// Smallest.
        min: u16,
        /// Largest.
        max: u16,
    },
    /// Not eight hexadecimal digits.
    Hexadecimal(&'a str),
    /// No such signal.
    Signal {
        /// The word.
        word: &'a str,
        /// A signal that is spelt like it.
        near: Option<&'static str>,
    },
    /// No such setting.
    Key {
        /// The word.
        word: &'a str,
        /// A setting that is spelt like it.
        near: Option<&'static str>,
    },
    /// Not a value of the setting.
    Value {
        /// The setting.
        key: Key,
        /// The word.
        word: &'a str,
        /// The reason.
        why: ValueError,
    },
}

impl fmt::Display for ParseError<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command { word, near } => {
                write!(f, "no such command: {word}; ")?;
                meant(f, *near)?;
                f.write_str("`help` lists them")
            }
            Self::Missing(what) => write!(f, "{what} is missing"),
            Self::TooMuch(word) => write!(f, "too many words, from `{word}` on"),
            Self::TooMany { what, most } => write!(f, "more than {most} {what}"),
            Self::Number { what, word } => write!(f, "not a number: {word} ({what})"),
            Self::OneOf { what, word, all } => {
                write!(f, "{what} = {word}: not one of: {all}")
            }
            Self::Whole { what, word, min, max } => {
                write!(f, "{what} = {word}: not a whole number from {min} to {max}")
            }
            Self::Hexadecimal(word) => write!(f, "not eight hexadecimal digits: {word}"),
            Self::Signal { word, near } => {
                write!(f, "no such signal: {word}; ")?;
                meant(f, *near)?;
                f.write_str("there are:")?;
                SIGNALS.iter().try_for_each(|signal| write!(f, " {}", signal.name))
            }
            Self::Key { word, near } => {
                write!(f, "no such setting: {word}; ")?;
                meant(f, *near)?;
                f.write_str("`get` lists them")
            }
            Self::Value { key, word, why } => write!(f, "{} = {word}: {why}", key.name()),
        }
    }
}

/// Writes the word that may have been meant.
fn meant(f: &mut fmt::Formatter<'_>, near: Option<&str>) -> fmt::Result {
    near.map_or(Ok(()), |near| write!(f, "did you mean `{near}`? "))
}
