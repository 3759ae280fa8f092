//! Sessions without a person: lines that are typed at given times, and checks of the answers.
//!
//! ```text
//! # comment
//! at 3: start             types `start` 3 s after power-on, at once if that has passed
//! wait for torque:        goes on when console or log have said a line with `torque:` since the last one
//! wait 0.5: torque 1      types `torque 1` half a second after that
//! expect ok               console or log have said a line with `ok` since the last typed line, or do within 8 s
//! expect 2s ok            the same within 2 s
//! expect not fault        they have said no line with `fault` since the last typed line, and do not for 1 s
//! expect not 5s fault     the same for 5 s
//! wait 1: !reset          presses the reset button; see [`super::own`]
//! wait 1: quit            ends the session
//! ```
//!
//! A strict script fails at the first answer `error:` that no following `expect` or `wait for` names, at the first text
//! that does not come, and if a fault is latched at its end.

mod step;

use std::path::Path;

use anyhow::{Result, bail};
use hil_sim::Error;

use super::own::Own;
use step::Step;

/// Longest wait for a text, s.
const PATIENCE_S: f64 = 30.0;
/// Time from the last step to the end of the session, s, in which the last answer can still come.
const LAST_ANSWER_S: f64 = 0.5;
/// The line that asks for a latched fault, and the beginning of the answer if there is one.
const FAULTS: (&str, &str) = ("faults", "latched");

/// The next action of a script.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Due {
    /// No action.
    Nothing,
    /// Type this line.
    Type(String),
    /// A check has failed and is only noted.
    Note(String),
    /// The script is at its end.
    #[default]
    End,
}

/// A line of the file.
#[derive(Clone, Debug)]
struct Placed {
    number: usize,
    text: String,
    step: Step,
}

/// A script and its progress.
#[derive(Clone, Debug, Default)]
pub struct Script {
    steps: Vec<Placed>,
    next: usize,
    /// Time of the last step, s.
    since: f64,
    /// Whether the text of `wait for` has come.
    heard: bool,
    /// The last step that typed a line.
    typed: Option<usize>,
    /// Lines that have come since then.
    answers: Vec<String>,
    /// The first unexpected answer that is an error.
    unexpected: Option<String>,
    strict: bool,
    /// Whether the question for a latched fault was sent.
    at_end: bool,
    /// `quit`, if the script ends so.
    end_with: Due,
}

impl Script {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or a line has none of the forms.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::Refused(format!("--script {name}: {e}")))?;
        Self::parse(&text).map_err(|why| Error::Refused(format!("{name}, {why}")).into())
    }

    /// Parses the text of a script.
    ///
    /// # Errors
    /// The number of the first line with none of the forms, and the reason.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut steps = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let (number, line) = (index + 1, line.trim());
            if !line.is_empty() && !line.starts_with('#') {
                let step = Step::parse(line);
                let step = step.map_err(|why| format!("line {number}: `{line}`: {why}"))?;
                steps.push(Placed { number, text: line.to_owned(), step });
            }
        }
        Ok(Self { steps, ..Self::default() })
    }

    /// Makes the script fail at unexpected errors and at a fault at the end.
    pub fn strict(self) -> Self {
        Self { strict: true, ..self }
    }

    /// Processes a line from console or log.
    pub fn hear(&mut self, line: &str) {
        self.heard |= self.steps.get(self.next).is_some_and(|placed| placed.step.awaits(line));
        if line.starts_with("error:") && !self.expects(line) && self.unexpected.is_none() {
            self.unexpected = Some(self.failure(self.typed, &format!("answered `{line}`")));
        }
        self.answers.push(line.to_owned());
    }

    /// Whether a step between the last typed line and the next one waits for this line.
    fn expects(&self, line: &str) -> bool {
        let behind = self.typed.map_or(0, |typed| typed + 1);
        let steps = self.steps[behind..].iter().map(|placed| &placed.step);
        steps.take_while(|step| !step.types()).any(|step| step.awaits(line))
    }

    /// Returns a line with this text that has come since the last typed one.
    fn answer(&self, text: &str) -> Option<&str> {
        self.answers.iter().map(String::as_str).find(|line| line.contains(text))
    }

    /// Describes a failure at a step.
    fn failure(&self, step: Option<usize>, why: &str) -> String {
        match step.and_then(|step| self.steps.get(step)) {
            Some(Placed { number, text, .. }) => format!("script, line {number}: `{text}`: {why}"),
            None => format!("script, before its first line: {why}"),
        }
    }

    /// Handles the end of the session's time: returns the failure of a strict script that has received an unexpected
    /// error or is not at its end.
    pub fn cut_short(&mut self) -> Option<String> {
        let over = (self.next < self.steps.len())
            .then(|| self.failure(Some(self.next), "the time of the session is over"));
        self.unexpected.take().or(over).filter(|_| self.strict)
    }

    /// Returns the action due at this time, s since power-up.
    ///
    /// # Errors
    /// A check has failed.
    pub fn due(&mut self, now: f64) -> Result<Due> {
        if let Some(why) = self.unexpected.take().filter(|_| self.strict) {
            bail!(why);
        }
        let Some(Placed { step, .. }) = self.steps.get(self.next) else { return self.end(now) };
        let passed = now - self.since;
        let due = match step {
            Step::At(at, line) if now >= *at => Due::Type(line.clone()),
            Step::After(wait, line) if passed >= *wait => Due::Type(line.clone()),
            Step::For(_) if self.heard => Due::Nothing,
            Step::For(text) if passed > PATIENCE_S => bail!(self.silence(text, PATIENCE_S)),
            Step::Expect(_, text) if self.answer(text).is_some() => Due::Nothing,
            Step::Expect(within, text) if passed > *within => {
                Due::Note(self.silence(text, *within))
            }
            Step::ExpectNot(during, text) => match self.answer(text) {
                Some(line) => Due::Note(self.failure(Some(self.next), &format!("said `{line}`"))),
                None if passed > *during => Due::Nothing,
                None => return Ok(Due::Nothing),
            },
            _ => return Ok(Due::Nothing),
        };
        match &due {
            Due::Note(why) if self.strict => bail!("{why}"),
            Due::Type(line) => {
                if self.strict && Own::parse(line) == Ok(Some(Own::Quit)) {
                    self.end_with = Due::Type(line.clone());
                    self.next = self.steps.len();
                    self.since = now;
                    return Ok(Due::Nothing);
                }
                self.typed = Some(self.next);
                self.answers.clear();
            }
            _ => {}
        }
        self.next += 1;
        self.since = now;
        self.heard = false;
        Ok(due)
    }

    /// After the last step it waits for the last answer; then a strict script asks for a latched fault.
    fn end(&mut self, now: f64) -> Result<Due> {
        if now < self.since + LAST_ANSWER_S {
            return Ok(Due::Nothing);
        }
        if !self.strict {
            return Ok(Due::End);
        }
        if !self.at_end {
            self.at_end = true;
            self.since = now;
            self.answers.clear();
            return Ok(Due::Type(FAULTS.0.to_owned()));
        }
        match self.answers.iter().find(|line| line.starts_with(FAULTS.1)) {
            Some(fault) => bail!(self.failure(self.typed, &format!("at the end: {fault}"))),
            None => Ok(self.end_with.clone()),
        }
    }

    fn silence(&self, text: &str, within: f64) -> String {
        self.failure(Some(self.next), &format!("nothing said `{text}` within {within} s"))
    }
}
