//! The reason why a line is invalid.

use core::fmt;

use drive_settings::value::ValueError;
use thiserror::Error;

use crate::console::line::LONGEST_TAG;
use crate::recording::trace::SIGNALS;
use crate::settings::keys::Key;

/// The tag of a request is too long or empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "a tag has 1 to {LONGEST_TAG} characters between `@` and a space; the request was not carried out"
)]
pub struct TagError;

/// Reason why a line is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ParseError<'a> {
    /// No such command or setting.
    #[error("no such {what}: {word}; {}`{list}` lists them", meant(*.near))]
    Unknown {
        /// The thing that the word names, and the command that lists all.
        what: &'static str,
        /// See `what`.
        list: &'static str,
        /// The word.
        word: &'a str,
        /// A known word that is spelt like it.
        near: Option<&'static str>,
    },
    /// This word is missing.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// More words than the command takes.
    #[error("too many words, from `{0}` on")]
    TooMuch(&'a str),
    /// More items than allowed.
    #[error("more than {0} {1}")]
    TooMany(usize, &'static str),
    /// The word is not a finite number with this meaning and unit.
    #[error("not a number: {0} ({1})")]
    Number(&'a str, &'static str),
    /// Not one of these words.
    #[error("{what} = {word}: not one of: {all}")]
    OneOf {
        /// Meaning of the word.
        what: &'static str,
        /// The word.
        word: &'a str,
        /// All that are allowed.
        all: &'static str,
    },
    /// Not a whole number in this range.
    #[error("{what} = {word}: not a whole number from {min} to {max}")]
    Whole {
        /// Meaning of the number.
        what: &'static str,
        /// The word.
        word: &'a str,
        /// Smallest.
        min: u32,
        /// Largest.
        max: u32,
    },
    /// Not eight hexadecimal digits.
    #[error("not eight hexadecimal digits: {0}")]
    Hexadecimal(&'a str),
    /// No signal has this name; another is spelt like it.
    #[error("no such signal: {0}; {near}there are:{all}", near = meant(*.1), all = signals())]
    Signal(&'a str, Option<&'static str>),
    /// Not a value of the setting.
    #[error("{} = {word}: {why}", .key.name())]
    Value {
        /// The setting.
        key: Key,
        /// The word.
        word: &'a str,
        /// The reason.
        why: ValueError,
    },
}

/// The word that may have been meant.
fn meant(near: Option<&'static str>) -> impl fmt::Display {
    fmt::from_fn(move |f| near.map_or(Ok(()), |near| write!(f, "did you mean `{near}`? ")))
}

/// The names of all signals.
fn signals() -> impl fmt::Display {
    fmt::from_fn(|f| SIGNALS.iter().try_for_each(|signal| write!(f, " {}", signal.name)))
}
