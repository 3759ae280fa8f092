//! Requests for a trace and for a stream.

use drive_settings::value;

use super::{LARGEST_DIVIDER, LONGEST_TRACE, ParseError, Words, nearest, whole};
use crate::board::PWM_HZ;
use crate::recording::stream::Stream;
use crate::recording::trace::{self, Plan, SIGNALS, SignalChoice, Trigger};

/// The trace with this number of records.
pub(super) fn plan<'a>(records: &'a str, words: &mut Words<'a>) -> Result<Plan, ParseError<'a>> {
    let records = whole("the number of records", records, 1, LONGEST_TRACE)?;
    let mut plan =
        Plan { records, divider: 1, choice: SignalChoice::none(), trigger: Trigger::Now };
    let mut next = words.optional();
    if let Some(text) = next
        && text.starts_with(|c: char| c.is_ascii_digit() || c == '-')
    {
        plan.divider = whole("the divider", text, 1, LARGEST_DIVIDER)?;
        next = words.optional();
    }
    while let Some(name) = next {
        if name == "on" {
            plan.trigger = trigger(words)?;
            break;
        }
        if !plan.choice.add(signal(name)?) {
            return Err(ParseError::TooMany(trace::MOST, "signals"));
        }
        next = words.optional();
    }
    if plan.choice.signals().next().is_none() {
        plan.choice = SignalChoice::usual();
    }
    Ok(plan)
}

/// Frames per second of a stream for which no rate is given.
const USUAL_RATE: u16 = 100;

/// The stream with this signal and others.
pub(super) fn stream<'a>(first: &'a str, words: &mut Words<'a>) -> Result<Stream, ParseError<'a>> {
    let (mut rate, mut alive_s, mut choice) = (USUAL_RATE, 0.0, SignalChoice::none());
    let mut next = Some(first);
    while let Some(word) = next {
        if word == "alive" {
            let word = words.next("the seconds")?;
            let tenths = value::number(word).filter(|s| ALIVE_S.contains(s));
            let (what, all) = ("the seconds without a line", "0.1 to 10");
            alive_s = tenths.ok_or(ParseError::OneOf { what, word, all })?;
        } else if word.starts_with(|c: char| c.is_ascii_digit() || c == '-') {
            rate = whole("the frames a second", word, 1, PWM_HZ as u16)?;
        } else if !choice.add(signal(word)?) {
            return Err(ParseError::TooMany(trace::MOST, "signals"));
        }
        next = words.optional();
    }
    if choice.signals().next().is_none() {
        return Err(ParseError::Missing("a signal"));
    }
    let divider = (PWM_HZ as u16 + rate / 2) / rate;
    Ok(Stream { choice, divider, alive_s })
}

/// Limits of `alive`, s.
const ALIVE_S: core::ops::RangeInclusive<f32> = 0.1..=10.0;

fn signal(word: &str) -> Result<u8, ParseError<'_>> {
    let near = || nearest(word, SIGNALS.iter().map(|signal| signal.name));
    trace::find(word).ok_or_else(|| ParseError::Signal(word, near()))
}

fn trigger<'a>(words: &mut Words<'a>) -> Result<Trigger, ParseError<'a>> {
    match words.next("fault, or a signal")? {
        "fault" => Ok(Trigger::Fault),
        name => {
            let signal = signal(name)?;
            let sides = [("above", true), ("below", false)];
            let above = words.one_of("above or below", "above below", &sides)?;
            Ok(Trigger::Level { signal, level: words.number("the level")?, above })
        }
    }
}
