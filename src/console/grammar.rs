//! The grammar: a line in, a [`Request`] or a [`ParseError`] out.

mod backup;
mod error;
mod recording;
mod request;
#[cfg(test)]
mod tests;

use core::str::SplitAsciiWhitespace;

use drive_commission::Step;
use drive_core::{Fault, Mode, Stop, homing};
use drive_settings::value::{self, Words as _};

use super::line::Tag;
use super::suggest::nearest;
use crate::board;
use crate::boards;
use crate::desk::order::Order;
use crate::settings::keys::{self, Key};
use crate::settings::staging::{Assignments, MOST};

use backup::{hexadecimal, restore};
pub use error::{ParseError, TagError};
pub use recording::Stream;
pub use request::{LEVELS, Level, Request, WORDS_IN_LINE};

/// Most records of a trace.
const LONGEST_TRACE: u16 = board::TRACE_RECORDS as u16;
/// Largest divider of a trace.
const LARGEST_DIVIDER: u16 = 1000;

/// The commands. The permanent number of each is its place, from 1: a new command comes last, and `-` takes the place of a retired one.
pub const COMMANDS: &str = "help status start commission accept learn stop relock torque speed jog position home angle get \
    describe set apply revert save defaults backup learned faults history clear trace stream baud \
    log echo reboot board confirm version h ? update";

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

    fn number(&mut self, what: &'static str) -> Result<f32, ParseError<'a>> {
        let word = self.next(what)?;
        value::number(word).ok_or(ParseError::Number { what, word })
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
    let word = words.next("a command")?;
    let request = match order(word, &mut words)? {
        Some(order) => Request::Order(order),
        None => match word {
            "help" | "h" | "?" => Request::Help,
            "status" => Request::Status,
            "history" => Request::History,
            // An alias of `set angle_source`.
            "angle" => {
                let key = setting("angle_source")?;
                let word = words.next("encoder or injection")?;
                let value = key.parse(word);
                let value = value.map_err(|why| ParseError::Value { key, word, why })?;
                Request::Set([(key, value)].into_iter().collect())
            }
            "set" => Request::Set(assignments(&mut words)?),
            "get" => match words.optional() {
                None => Request::List(""),
                Some(name) => match keys::find(name) {
                    Some(key) => Request::Get(key),
                    None => Request::List(prefix(name)?),
                },
            },
            "describe" => match words.optional() {
                Some("stream") => Request::Signals,
                word => Request::Describe(word.map_or(Ok(""), prefix)?),
            },
            "backup" => Request::Backup,
            "learned" => match words.optional() {
                None => Request::Learned,
                Some("check") => Request::Restored(hexadecimal(words.next("the checksum")?)?),
                Some(index) => restore(index, &mut words)?,
            },
            "faults" => Request::Faults(words.optional().map(fault).transpose()?),
            "trace" => match words.optional() {
                None => Request::ShowTrace,
                Some("off") => Request::EndTrace,
                Some(records) => Request::Trace(recording::plan(records, &mut words)?),
            },
            "stream" => match words.optional() {
                None => Request::StreamState,
                Some("off") => Request::EndStream,
                Some(signal) => Request::Stream(recording::stream(signal, &mut words)?),
            },
            "baud" => {
                let word = words.next("the bits per second")?;
                let (min, max) = (board::SERIAL_BAUD, board::SERIAL_BAUD_MAX);
                Request::Baud(whole("the bits per second", word, min, max)?)
            }
            "log" => {
                Request::Log(words.one_of("the level", "off error warn info debug", &LEVELS)?)
            }
            "board" => {
                match words.optional() {
                    None => Request::Board,
                    Some(word) => Request::Order(Order::BoardIs(boards::find(word).ok_or(
                        ParseError::OneOf { what: "the board", word, all: boards::ALL_NAMES },
                    )?)),
                }
            }
            "version" => Request::Version,
            word => {
                return Err(ParseError::Command { word, near: nearest(word, COMMANDS.split(' ')) });
            }
        },
    };
    words.optional().map_or(Ok(request), |word| Err(ParseError::TooMuch(word)))
}

/// The request to the command arbiter that begins with this word; `None` if no such request does.
fn order<'a>(word: &str, words: &mut Words<'a>) -> Result<Option<Order>, ParseError<'a>> {
    Ok(Some(match word {
        "start" => match words.optional() {
            None | Some("torque") => Order::Start(Mode::Torque),
            Some("speed") => Order::Start(Mode::Speed),
            Some("position") => Order::Start(Mode::Position),
            Some("vf") => Order::Start(Mode::VoltsPerHertz),
            Some("learning") => Order::Learn { again: false },
            Some(word) => {
                let all = "torque speed position vf learning";
                return Err(ParseError::OneOf { what: "the mode", word, all });
            }
        },
        "commission" => match words.optional() {
            None => Order::Commission(Step::Nameplate, Step::LAST),
            Some(word) => {
                let first = step(word)?;
                Order::Commission(first, words.optional().map_or(Ok(first), step)?)
            }
        },
        "accept" => Order::Accept,
        "learn" => match words.optional() {
            None => Order::Learn { again: false },
            Some("again") => Order::Learn { again: true },
            Some(word) => return Err(ParseError::TooMuch(word)),
        },
        "stop" => match words.optional() {
            None => Order::Stop(Stop::Coast),
            Some("ramp") => Order::Stop(Stop::Ramp),
            Some("quick") => Order::Stop(Stop::Quick),
            Some("now") => Order::Stop(Stop::Now),
            Some(word) => {
                return Err(ParseError::OneOf { what: "the way to stop", word, all: "ramp quick now" });
            }
        },
        "relock" => Order::Relock,
        "torque" => Order::Torque(words.number("the current, A")?),
        "speed" => Order::Speed(words.number("the speed, rpm")?),
        "jog" => Order::Jog(words.number("the speed, rpm")?),
        "position" => Order::Position(words.number("the position, turns")?),
        "home" => Order::Home(homing::Plan {
            rpm: words.number("the speed, rpm")?,
            i_q: words.number("the current, A")?,
            turns: words.number("the longest way, turns")?,
        }),
        "apply" => Order::Apply,
        "revert" => Order::Revert,
        "save" => Order::Save,
        "defaults" => Order::Defaults,
        "clear" => Order::Clear,
        "echo" => {
            Order::Echo(words.one_of("on or off", "on off", &[("on", true), ("off", false)])?)
        }
        "reboot" => match words.optional() {
            None => Order::Reboot(false),
            Some("now") => Order::Reboot(true),
            Some(word) => return Err(ParseError::TooMuch(word)),
        },
        // ST's loader holds PA9 high (AN2606).
        "update" => words.one_of(
            "`gates-off`: ST's loader switches a gate on, so the supply of the gate drivers must be off. That word",
            "gates-off",
            &[("gates-off", Order::Update)],
        )?,
        "confirm" => words.one_of("what to confirm", "board", &[("board", Order::Confirm)])?,
        _ => return Ok(None),
    }))
}

/// The step of the commissioning with this name.
fn step(word: &str) -> Result<Step, ParseError<'_>> {
    let place = Step::WORDS.iter().position(|known| *known == word);
    place.map(Step::at).ok_or(ParseError::OneOf { what: "the step", word, all: Step::ALL })
}

/// The setting with this name.
fn setting(word: &str) -> Result<Key, ParseError<'_>> {
    let near = || nearest(word, keys::all().map(Key::name));
    keys::find(word).ok_or_else(|| ParseError::Key { word, near: near() })
}

/// The same beginning of a name, from the table.
fn prefix(word: &str) -> Result<&'static str, ParseError<'_>> {
    let beginning = keys::all().find_map(|key| {
        let name = key.name();
        name.starts_with(word).then(|| name.get(..word.len())).flatten()
    });
    beginning.map_or_else(|| setting(word).map(Key::name), Ok)
}

/// Settings and values by turns.
fn assignments<'a>(words: &mut Words<'a>) -> Result<Assignments, ParseError<'a>> {
    let mut all = Assignments::new();
    let mut name = words.next("the setting")?;
    loop {
        let key = setting(name)?;
        let word = words.next("the value")?;
        let value = key.parse(word).map_err(|why| ParseError::Value { key, word, why })?;
        all.push((key, value)).map_err(|_| ParseError::TooMany { what: "settings", most: MOST })?;
        match words.optional() {
            Some(next) => name = next,
            None => return Ok(all),
        }
    }
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
