//! The grammar: a line in, a [`Request`] or a [`ParseError`] out.

mod backup;
mod commands;
mod error;
mod recording;
mod request;
#[cfg(test)]
mod tests;

use core::str::SplitAsciiWhitespace;

use drive_commission::Step;
use drive_core::Fault;
use drive_settings::value::{self, Value, Words as _};

use super::line::Tag;
use super::suggest::nearest;
use crate::board;
use crate::settings::keys::{self, Key};
use crate::settings::staging::{Assignments, MOST};

#[cfg(test)]
pub use commands::NUMBERS;
pub use commands::{COMMANDS, HELP, HELP_END};
pub use error::{ParseError, TagError};
pub use request::{ListKind, Request, WORDS_IN_LINE};

/// Most records of a trace.
const LONGEST_TRACE: u16 = board::TRACE_RECORDS as u16;
/// Largest divider of a trace.
const LARGEST_DIVIDER: u16 = 1000;

/// The words of a line.
struct Words<'a>(SplitAsciiWhitespace<'a>);

impl<'a> Words<'a> {
    fn next(&mut self, what: &'static str) -> Result<&'a str, ParseError<'a>> {
        self.0.next().ok_or(ParseError::Missing(what))
    }

    fn optional(&mut self) -> Option<&'a str> {
        self.0.next()
    }

    /// One of these words.
    fn one_of<T: Clone>(
        &mut self,
        what: &'static str,
        all: &'static str,
        words: &[(&str, T)],
    ) -> Result<T, ParseError<'a>> {
        let word = self.next(what)?;
        let found = words.iter().find(|(known, _)| *known == word);
        found.map(|(_, value)| value.clone()).ok_or(ParseError::OneOf { what, word, all })
    }

    /// One of these words, or none.
    fn optional_of<T: Clone>(
        &mut self,
        none: T,
        what: &'static str,
        all: &'static str,
        words: &[(&str, T)],
    ) -> Result<T, ParseError<'a>> {
        if self.0.clone().next().is_none() { Ok(none) } else { self.one_of(what, all, words) }
    }

    /// Whether this word follows; no other may.
    fn flag(&mut self, known: &str) -> Result<bool, ParseError<'a>> {
        let next = self.optional();
        next.map_or(Ok(false), |word| {
            (word == known).then_some(true).ok_or(ParseError::TooMuch(word))
        })
    }

    fn number(&mut self, what: &'static str) -> Result<f32, ParseError<'a>> {
        let word = self.next(what)?;
        value::number(word).ok_or(ParseError::Number(word, what))
    }
}

/// The tag of a line, and the request after it: `@17 status` is the request `status` with the tag `17`.
///
/// # Errors
/// The tag has no characters or more than [`LONGEST_TAG`](super::line::LONGEST_TAG).
pub fn tagged(line: &str) -> Result<(Option<Tag>, &str), TagError> {
    let Some(tagged) = line.strip_prefix('@') else { return Ok((None, line)) };
    let (tag, request) = tagged.split_once(' ').unwrap_or((tagged, ""));
    let tag = Tag::try_from(tag).ok().filter(|tag| !tag.is_empty()).ok_or(TagError)?;
    Ok((Some(tag), request))
}

/// Parses one request, in lower case.
///
/// # Errors
/// The first invalid or missing word. A line is valid as a whole or not at all.
pub fn parse(line: &str) -> Result<Request, ParseError<'_>> {
    let mut words = Words(line.split_ascii_whitespace());
    let request = commands::request(words.next("a command")?, &mut words)?;
    words.optional().map_or(Ok(request), |word| Err(ParseError::TooMuch(word)))
}

/// The step of the commissioning with this name.
fn step(word: &str) -> Result<Step, ParseError<'_>> {
    let place = Step::WORDS.iter().position(|known| *known == word);
    place.map(Step::at).ok_or(ParseError::OneOf { what: "the step", word, all: Step::ALL })
}

/// The setting with this name.
fn setting(word: &str) -> Result<Key, ParseError<'_>> {
    let near = || nearest(word, keys::all().map(Key::name));
    keys::find(word).ok_or_else(|| ParseError::Unknown {
        what: "setting",
        list: "get",
        word,
        near: near(),
    })
}

/// The same beginning of a name, from the table.
fn prefix(word: &str) -> Result<&'static str, ParseError<'_>> {
    let name = keys::all().map(Key::name).find(|name| name.starts_with(word));
    let beginning = name.and_then(|name| name.get(..word.len()));
    beginning.map_or_else(|| setting(word).map(Key::name), Ok)
}

/// Settings and values by turns.
fn assignments<'a>(words: &mut Words<'a>) -> Result<Assignments, ParseError<'a>> {
    let (mut all, mut next) = (Assignments::new(), Some(words.next("the setting")?));
    while let Some(name) = next {
        let assigned = assigned(setting(name)?, words.next("the value")?)?;
        all.push(assigned).map_err(|_| ParseError::TooMany(MOST, "settings"))?;
        next = words.optional();
    }
    Ok(all)
}

/// A setting with the value that this word stands for.
fn assigned(key: Key, word: &str) -> Result<(Key, Value), ParseError<'_>> {
    let value = key.parse(word).map_err(|why| ParseError::Value { key, word, why })?;
    Ok((key, value))
}

/// The fault with this number.
fn fault(word: &str) -> Result<Fault, ParseError<'_>> {
    let last = Fault::ALL.last().map_or(0, |fault| fault.code());
    let code = whole("the fault", word, 1, last.into())?;
    let found = Fault::ALL.iter().find(|fault| u16::from(fault.code()) == code);
    // The number is not in use any more.
    let all = "the numbers that `docs/faults.md` lists";
    found.copied().ok_or(ParseError::OneOf { what: "the fault", word, all })
}

fn whole<'a, T>(what: &'static str, word: &'a str, min: T, max: T) -> Result<T, ParseError<'a>>
where
    T: Copy + Into<u32> + PartialOrd + core::str::FromStr,
{
    let (min_u32, max_u32) = (min.into(), max.into());
    let value = word.parse().ok().filter(|value| (min..=max).contains(value));
    value.ok_or(ParseError::Whole { what, word, min: min_u32, max: max_u32 })
}
