//! The steps as data. Only [`Table::next`] hands out a step to walk through, so that nothing switches the power stage
//! on before gates and fault input were judged.

use super::evidence::{Evidence, Verdict};
use crate::experiments::source::formula::evaluate;
use crate::prelude::*;

/// First words of the lines after which every gate stays off. Any other line counts as one that switches the power stage on.
#[rustfmt::skip]
const HARMLESS: [&str; 13] = [
    "status", "version", "faults", "board", "get", "set", "save", "clear", "trace", "stop", "backup", "accept", "reboot",
];

/// The boards with their values, and the steps.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Table {
    /// The boards.
    #[serde(rename = "board")]
    pub boards: Vec<Board>,
    /// The parts, in order.
    #[serde(rename = "part")]
    pub parts: Vec<Part>,
}

/// A board with its values.
#[derive(Clone, Debug, Deserialize)]
pub struct Board {
    /// Its name, as the firmware reports it.
    pub name: String,
    /// Its values by name, in capitals.
    #[serde(flatten)]
    pub values: BTreeMap<String, String>,
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

/// A step.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Its name in the test record.
    pub name: String,
    /// Whether it judges gates or fault input: the power stage stays off until all such steps were passed.
    #[serde(default)]
    pub judges: bool,
    /// Whether it may be skipped.
    #[serde(default)]
    pub optional: bool,
    /// Whether it is for boards with three current sensors.
    #[serde(default)]
    pub third: bool,
    /// Longest wait for an expected line, s.
    pub patience_s: Option<f64>,
    /// Its actions, in order.
    pub acts: Vec<Act>,
    /// Causes to check if it does not give the expected result.
    pub otherwise: String,
}

/// One thing to do, to hear or to measure; `steps.toml` explains the kinds.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[expect(missing_docs, reason = "the head of the table explains them to those who write it")]
pub enum Act {
    Hand(String),
    Restart(String),
    Send(String),
    Often { line: String, times: u32 },
    Setting(String),
    Wait(f64),
    Hear(String),
    Never(String),
    See(String),
    Measure { what: String, unit: String, is: Limits },
    Read(Read),
    Noise(String),
}

/// Lower and upper limit of the allowed numbers, as expressions.
pub type Limits = [String; 2];

/// A number in an answer.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Read {
    /// The text that precedes the number.
    pub after: Option<String>,
    /// The text that follows the number.
    pub before: Option<String>,
    /// Its unit.
    pub unit: String,
    /// Whether the limits are relative to the previous reading.
    #[serde(default)]
    pub rise: bool,
    /// The allowed range.
    pub is: Limits,
}

/// A step that may be walked through now. Only [`Table::next`] makes it.
pub struct Ready<'a> {
    number: usize,
    part: &'a Part,
    step: &'a Step,
}

impl<'a> Ready<'a> {
    /// Returns its number, the step, and its part if it is the first step of that part.
    pub fn place(&self) -> (usize, &'a Step, Option<&'a Part>) {
        let first = self.part.steps.first().is_some_and(|first| first.name == self.step.name);
        (self.number, self.step, first.then_some(self.part))
    }
}

impl Table {
    /// Returns the table of this program.
    ///
    /// # Errors
    /// [`Error::Internal`] for an invalid table; a test reads it.
    pub fn read() -> Result<Self, Error> {
        toml::from_str(include_str!("steps.toml")).map_err(|why| Error::Internal(why.to_string()))
    }

    /// Returns the board of a name.
    ///
    /// # Errors
    /// [`Error::Unknown`].
    pub fn board(&self, name: &str) -> Result<&Board, Error> {
        let names = self.boards.iter().map(|board| board.name.as_str());
        let found = self.boards.iter().find(|board| board.name == name);
        found.ok_or_else(|| Error::unknown("board", name, names))
    }

    /// Returns all steps with their parts, in order.
    pub fn steps(&self) -> impl Iterator<Item = (&Part, &Step)> {
        self.parts.iter().flat_map(|part| part.steps.iter().map(move |step| (part, step)))
    }

    /// Returns the first step that the test record does not have; none at the end.
    ///
    /// # Errors
    /// [`Error::Refused`] for a step that would switch the power stage on before every step that judges gates and fault input was passed.
    pub fn next(&self, evidence: &Evidence) -> Result<Option<Ready<'_>>, Error> {
        let third = self.board(&evidence.board)?.has_third_sensor();
        let passed = |step: &Step| evidence.verdict(&step.name) == Some(Verdict::Passed);
        let skipped = |step: &Step| evidence.verdict(&step.name) == Some(Verdict::Skipped);
        let left =
            |step: &Step| !(passed(step) || step.optional && skipped(step) || step.third && !third);
        let first = self.steps().enumerate().find(|(_, (_, step))| left(step));
        let Some((index, (part, step))) = first else { return Ok(None) };
        let unjudged = self.steps().map(|(_, step)| step).find(|step| step.judges && !passed(step));
        match unjudged.filter(|_| step.switches_on()) {
            None => Ok(Some(Ready { number: index + 1, part, step })),
            Some(judge) => Err(Error::Refused(format!(
                "step {} switches the stage on before step {} was passed",
                step.name, judge.name
            ))),
        }
    }
}

impl Step {
    /// Whether one of its lines can switch a gate on.
    pub fn switches_on(&self) -> bool {
        self.acts.iter().any(|act| match act {
            Act::Send(line) | Act::Often { line, .. } => {
                line.split(' ').next().is_none_or(|word| !HARMLESS.contains(&word))
            }
            _ => false,
        })
    }
}

impl Board {
    /// Replaces the names of the board's values in a text by the values, and NAME by the board's name.
    pub fn fill(&self, text: &str) -> String {
        // From the last to the first, because a name comes before another one that is its beginning.
        let text = text.replace("NAME", &self.name);
        self.values.iter().rev().fold(text, |text, (name, value)| text.replace(name, value))
    }

    /// Returns the value of an expression. An invalid one gives a value that is not a number, and no reading lies within it.
    pub fn number(&self, expression: &str) -> f64 {
        let value = |name: &str| self.values.get(name)?.parse().ok();
        evaluate(expression, &value).unwrap_or(f64::NAN)
    }

    /// Whether the board has three current sensors.
    pub fn has_third_sensor(&self) -> bool {
        self.number("SENSORS") == 3.0
    }
}

impl Read {
    /// Returns the text next to the number.
    pub fn place(&self) -> &str {
        self.after.as_deref().or(self.before.as_deref()).unwrap_or_default()
    }

    /// Returns the number in a line.
    pub fn of(&self, line: &str) -> Option<f64> {
        let (before, after) = line.split_once(self.place())?;
        let word = match self.after {
            Some(_) => after.split(' ').next(),
            None => before.rsplit(' ').next(),
        };
        word?.parse().ok()
    }
}
