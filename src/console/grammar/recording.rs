//! What a trace is to record.

use super::{LARGEST_DIVIDER, LONGEST_TRACE, ParseError, Words, nearest, whole};
use crate::link::trace::{self, Plan, SIGNALS, SignalChoice, Trigger};

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
            return Err(ParseError::TooMany { what: "signals", most: trace::MOST });
        }
        next = words.optional();
    }
    if plan.choice.signals().next().is_none() {
        plan.choice = SignalChoice::usual();
    }
    Ok(plan)
}

fn signal(word: &str) -> Result<u8, ParseError<'_>> {
    let near = || nearest(word, SIGNALS.iter().map(|signal| signal.name));
    trace::find(word).ok_or_else(|| ParseError::Signal { word, near: near() })
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
