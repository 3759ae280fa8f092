//! Sessions without a person: lines that are typed at their time.
//!
//! ```text
//! # comment
//! at 3: start             types `start` 3 s after power-on, at once if that has passed
//! wait for torque:        goes on when console or log have said a line with `torque:` since the last one
//! wait 0.5: torque 1      types `torque 1` half a second after that
//! wait 1: quit            ends the session
//! ```

use std::path::Path;

use anyhow::{Result, bail};
use hil_sim::Error;

/// One line of a script.
#[derive(Clone, Debug, PartialEq)]
enum Step {
    /// Types a line at a time since power-on, s.
    At(f64, String),
    /// Types a line so long after the step before, s.
    After(f64, String),
    /// Goes on when a line with this text has come.
    For(String),
}

/// Longest wait for a text, s.
const PATIENCE_S: f64 = 30.0;
/// From the last step to the end of the session, s: the last answer is still heard.
const LAST_ANSWER_S: f64 = 0.5;
/// Longest time in a script, s: an hour, as for `seconds`.
const LONGEST_S: f64 = 3600.0;

/// The next action of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Due {
    /// Nothing.
    Nothing,
    /// Type this.
    Type(String),
    /// It is at its end.
    End,
}

/// A script and how far it has come.
#[derive(Clone, Debug, Default)]
pub struct Script {
    steps: Vec<Step>,
    next: usize,
    /// When the last step was done, s.
    since: f64,
    heard: bool,
}

impl Script {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read; a line that is none of the forms.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display();
        let text = std::fs::read_to_string(path)
            .map_err(|e| Error::Refused(format!("--script {name}: {e}")))?;
        Self::parse(&text).map_err(|why| Error::Refused(format!("{name}, {why}")).into())
    }

    /// Understands the text of a script.
    ///
    /// # Errors
    /// The number of the first line that is none of the forms, and why.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut steps = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let line = line.trim();
            if !line.is_empty() && !line.starts_with('#') {
                let step = Step::parse(line);
                steps.push(step.map_err(|why| format!("line {}: `{line}`: {why}", number + 1))?);
            }
        }
        Ok(Self { steps, ..Self::default() })
    }

    /// A line that console or log have said.
    pub fn hear(&mut self, line: &str) {
        if let Some(Step::For(text)) = self.steps.get(self.next) {
            self.heard |= line.contains(text.as_str());
        }
    }

    /// The action due at this time, s since power-on.
    ///
    /// # Errors
    /// A text that was waited for has not come.
    pub fn due(&mut self, now: f64) -> Result<Due> {
        let Some(step) = self.steps.get(self.next) else {
            let over = now >= self.since + LAST_ANSWER_S;
            return Ok(if over { Due::End } else { Due::Nothing });
        };
        let due = match step {
            Step::At(at, line) if now >= *at => Due::Type(line.clone()),
            Step::After(wait, line) if now >= self.since + wait => Due::Type(line.clone()),
            Step::For(_) if self.heard => Due::Nothing,
            Step::For(text) if now > self.since + PATIENCE_S => {
                bail!("script: nothing said `{text}` within {PATIENCE_S} s")
            }
            _ => return Ok(Due::Nothing),
        };
        self.next += 1;
        self.since = now;
        self.heard = false;
        Ok(due)
    }
}

impl Step {
    fn parse(line: &str) -> Result<Self, String> {
        if let Some(text) = line.strip_prefix("wait for ") {
            return Ok(Self::For(text.trim().to_owned()));
        }
        let forms = "write `at SECONDS: LINE`, `wait SECONDS: LINE` or `wait for TEXT`";
        let (word, rest) = line.split_once(' ').ok_or(forms)?;
        let (seconds, typed) = rest.split_once(':').ok_or(forms)?;
        let typed = typed.trim().to_owned();
        let seconds = match seconds.trim().parse() {
            Ok(seconds) if (0.0..=LONGEST_S).contains(&seconds) => seconds,
            _ => {
                return Err(format!("`{}`: not a number from 0 to {LONGEST_S} s", seconds.trim()));
            }
        };
        match word {
            "at" => Ok(Self::At(seconds, typed)),
            "wait" => Ok(Self::After(seconds, typed)),
            _ => Err(forms.into()),
        }
    }
}
