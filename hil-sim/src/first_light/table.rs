//! The steps as data. [`Table::next`] alone hands out a step to walk through, so that nothing switches the stage on before gates and
//! fault input were judged.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use serde::Deserialize;

use super::evidence::{Evidence, Verdict};
use crate::error::Error;

/// First words of the lines after which every gate stays off. Any other line counts as one that switches the stage on.
const HARMLESS: [&str; 13] = [
    "status", "version", "faults", "board", "save", "clear", "set", "trace", "stop", "backup",
    "accept", "reboot", "get",
];
/// Longest wait for a text of [`Act::Hear`], s.
const HEAR_S: f64 = 15.0;

/// The boards with their values, and the steps.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    #[serde(rename = "board")]
    boards: Vec<Board>,
    /// The parts, in order.
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
}

/// A number, or a text: the name of a board's value.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub enum Value {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

/// A board with its values.
#[derive(Clone, Debug, Deserialize)]
pub struct Board {
    /// Its name, as the firmware says it.
    pub name: String,
    /// By name, in capitals.
    #[serde(flatten)]
    pub values: BTreeMap<String, Value>,
}

/// Steps that share a set-up.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Its title.
    pub title: String,
    /// The set-up.
    pub before: String,
    /// Its steps, in order.
    #[serde(rename = "step")]
    pub steps: Vec<Step>,
}

/// What a step proves before the stage may be switched on.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum Judge {
    /// The gates are off when they have to be.
    Gates,
    /// The fault input switches off.
    Break,
}

/// A step.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Its name in the evidence.
    pub name: String,
    /// What it proves; the stage stays off until all such steps were passed.
    pub judges: Option<Judge>,
    /// Whether it may be skipped.
    #[serde(default)]
    pub optional: bool,
    /// In order.
    pub acts: Vec<Act>,
    /// Where to look if it does not give what it should.
    pub otherwise: String,
}

/// One thing to do, to hear or to measure; `steps.toml` explains them.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[expect(missing_docs, reason = "the head of the table explains them to those who write it")]
pub enum Act {
    Hand(String),
    Restart(String),
    Send(String),
    Often { line: String, times: u32 },
    Setting(String),
    Reboot(bool),
    Wait(f64),
    Hear(String),
    HearLate { text: String, seconds: f64 },
    Never(String),
    See(String),
    Measure { what: String, unit: String, is: Limits },
    Read(Read),
    Noise(String),
    Third(Box<Act>),
}

/// A number in an answer.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Read {
    /// It stands behind this text.
    pub after: Option<String>,
    /// It stands before this text.
    pub before: Option<String>,
    /// Its unit.
    pub unit: String,
    /// Where it has to be.
    pub is: Limits,
}

/// Where a number has to be.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
#[expect(missing_docs, reason = "as of the acts")]
pub enum Limits {
    Range { from: Value, to: Value },
    About { about: Value, share: f64 },
    Least { least: Value, plus: f64 },
    Below { below: Value },
    Rise { rise: Value, within: Value },
}

/// A step that may be walked through now. [`Table::next`] makes it.
pub struct Ready<'a> {
    number: usize,
    part: &'a Part,
    step: &'a Step,
}

impl<'a> Ready<'a> {
    /// The step.
    pub fn step(&self) -> &'a Step {
        self.step
    }

    /// Its number, and its part where it is the first of it.
    pub fn place(&self) -> (usize, Option<&'a Part>) {
        let first = self.part.steps.first().is_some_and(|first| first.name == self.step.name);
        (self.number, first.then_some(self.part))
    }
}

impl Table {
    /// The table of this program.
    ///
    /// # Errors
    /// [`Error::Internal`] for a table that is none; a test reads it.
    pub fn read() -> Result<Self, Error> {
        toml::from_str(include_str!("steps.toml")).map_err(|why| Error::Internal(why.to_string()))
    }

    /// The boards.
    pub fn boards(&self) -> &[Board] {
        &self.boards
    }

    /// The board of a name.
    ///
    /// # Errors
    /// [`Error::Unknown`].
    pub fn board(&self, name: &str) -> Result<&Board, Error> {
        let found = self.boards.iter().find(|board| board.name == name);
        found.ok_or_else(|| {
            Error::unknown("board", name, self.boards.iter().map(|board| board.name.as_str()))
        })
    }

    /// All steps with their parts, in order.
    pub fn steps(&self) -> impl Iterator<Item = (&Part, &Step)> {
        self.parts.iter().flat_map(|part| part.steps.iter().map(move |step| (part, step)))
    }

    /// The first step that the evidence does not have; none at the end.
    ///
    /// # Errors
    /// [`Error::Refused`] for a step that would switch the stage on before every step that judges gates and fault input was passed.
    pub fn next(&self, evidence: &Evidence) -> Result<Option<Ready<'_>>, Error> {
        let is_done = |step: &Step| match evidence.verdict(&step.name) {
            Some(Verdict::Skipped) => step.optional,
            verdict => verdict == Some(Verdict::Passed),
        };
        let first = self.steps().enumerate().find(|(_, (_, step))| !is_done(step));
        let Some((index, (part, step))) = first else { return Ok(None) };
        let passed = |step: &Step| evidence.verdict(&step.name) == Some(Verdict::Passed);
        let mut judges = self.steps().filter(|(_, step)| step.judges.is_some());
        if step.switches_on()
            && let Some((_, judge)) = judges.find(|(_, judge)| !passed(judge))
        {
            return Err(Error::Refused(format!(
                "step {} switches the stage on before step {} was passed",
                step.name, judge.name
            )));
        }
        Ok(Some(Ready { number: index + 1, part, step }))
    }
}

impl Step {
    /// Whether one of its lines can switch a gate on.
    pub fn switches_on(&self) -> bool {
        let lines = self.acts.iter().filter_map(|act| match act {
            Act::Send(line) | Act::Often { line, .. } => Some(line.as_str()),
            Act::Third(act) => match &**act {
                Act::Send(line) => Some(line.as_str()),
                _ => None,
            },
            _ => None,
        });
        lines.flat_map(|line| line.split(' ').next()).any(|word| !HARMLESS.contains(&word))
    }
}

impl Board {
    /// A text with the board's values in place of their names, and its own in place of NAME.
    pub fn fill(&self, text: &str) -> String {
        let is_name = |c: char| c.is_ascii_uppercase();
        let mut filled = String::new();
        let mut rest = text;
        while let Some(at) = rest.find(is_name) {
            let end = rest[at..].find(|c| !is_name(c)).map_or(rest.len(), |length| at + length);
            let word = &rest[at..end];
            filled += &rest[..at];
            filled += &match self.values.get(word) {
                Some(Value::Number(number)) => number.to_string(),
                Some(Value::Text(text)) => text.clone(),
                None if word == "NAME" => self.name.clone(),
                None => word.to_owned(),
            };
            rest = &rest[end..];
        }
        filled + rest
    }

    /// A number; one that the board does not have is none, and no reading is within it.
    pub fn number(&self, value: &Value) -> f64 {
        match value {
            Value::Number(number) => *number,
            Value::Text(name) => self.fill(name).parse().unwrap_or(f64::NAN),
        }
    }

    /// Whether it has three current sensors.
    pub fn has_third_sensor(&self) -> bool {
        self.values.get("SENSORS") == Some(&Value::Number(3.0))
    }
}

impl Act {
    /// Longest wait, s, and the text that has to be heard.
    pub fn heard(&self) -> Option<(&str, f64)> {
        match self {
            Self::Hear(text) => Some((text, HEAR_S)),
            Self::HearLate { text, seconds } => Some((text, *seconds)),
            _ => None,
        }
    }
}

impl Limits {
    /// The allowed numbers; `before` is the last reading of the same.
    pub fn range(&self, board: &Board, before: f64) -> RangeInclusive<f64> {
        match self {
            Self::Range { from, to } => board.number(from)..=board.number(to),
            Self::About { about, share } => {
                let about = board.number(about);
                about * (1.0 - share)..=about * (1.0 + share)
            }
            Self::Least { least, plus } => board.number(least)..=board.number(least) + plus,
            Self::Below { below } => f64::NEG_INFINITY..=board.number(below),
            Self::Rise { rise, within } => {
                let (middle, within) = (before + board.number(rise), board.number(within));
                middle - within..=middle + within
            }
        }
    }
}

impl Read {
    /// The text that it stands at.
    pub fn place(&self) -> &str {
        self.after.as_deref().or(self.before.as_deref()).unwrap_or_default()
    }

    /// The number in a line.
    pub fn of(&self, line: &str) -> Option<f64> {
        let word = match (&self.after, &self.before) {
            (Some(after), _) => line.split_once(after.as_str())?.1.split(' ').next()?,
            (None, before) => line.split_once(before.as_deref()?)?.0.rsplit(' ').next()?,
        };
        word.parse().ok()
    }
}
