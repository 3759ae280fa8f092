//! One line of a script.

use crate::interactive::own::Own;

/// Time within which an expected text must come, s, if the script states none: four times that of the slowest answer.
const EXPECTED_S: f64 = 8.0;
/// Time in which a text must not come, s, if the script states none.
const NOT_EXPECTED_S: f64 = 1.0;
/// Longest time in a script, s: an hour, as for `seconds`.
const LONGEST_S: f64 = 3600.0;

/// The action of a line.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Types a line at a time since power-on, s.
    At(f64, String),
    /// Types a line this long after the previous step, s.
    After(f64, String),
    /// Continues when a line with this text has come.
    For(String),
    /// A line with this text must have come since the last typed one, or come within a time, s.
    Expect(f64, String),
    /// No line with this text must have come since the last typed one, or come within a time, s.
    ExpectNot(f64, String),
}

impl Step {
    /// Parses a line.
    ///
    /// # Errors
    /// The line has none of the forms; the error states the reason.
    pub fn parse(line: &str) -> Result<Self, String> {
        if let Some(text) = line.strip_prefix("wait for ") {
            return Ok(Self::For(text.trim().to_owned()));
        }
        let forms = "write `at SECONDS: LINE`, `wait SECONDS: LINE`, `wait for TEXT`, \
                     `expect [SECONDSs] TEXT` or `expect not [SECONDSs] TEXT`";
        let (word, rest) = line.split_once(' ').ok_or(forms)?;
        if word == "expect" {
            return match rest.trim().strip_prefix("not ") {
                Some(rest) => within(rest, NOT_EXPECTED_S).map(|(s, t)| Self::ExpectNot(s, t)),
                None => within(rest, EXPECTED_S).map(|(s, t)| Self::Expect(s, t)),
            };
        }
        let (time, typed) = rest.split_once(':').ok_or(forms)?;
        let (time, typed) = (seconds(time.trim())?, typed.trim().to_owned());
        Own::parse(&typed)?;
        match word {
            "at" => Ok(Self::At(time, typed)),
            "wait" => Ok(Self::After(time, typed)),
            _ => Err(forms.into()),
        }
    }

    /// Whether the step types a line.
    pub fn types(&self) -> bool {
        matches!(self, Self::At(..) | Self::After(..))
    }

    /// Whether the step waits for a text that this line contains.
    pub fn awaits(&self, line: &str) -> bool {
        matches!(self, Self::For(text) | Self::Expect(_, text) if line.contains(text.as_str()))
    }
}

/// Returns time and text after `expect`; a first word such as `2s` or `0.5s` is a time.
fn within(text: &str, default: f64) -> Result<(f64, String), String> {
    let text = text.trim();
    let (first, rest) = text.split_once(' ').unwrap_or((text, ""));
    let number = first.strip_suffix('s').filter(|number| number.parse::<f64>().is_ok());
    let (time, text) = match number {
        Some(number) => (seconds(number)?, rest.trim()),
        None => (default, text),
    };
    if text.is_empty() {
        return Err("the text is missing".into());
    }
    Ok((time, text.to_owned()))
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|seconds| (0.0..=LONGEST_S).contains(seconds));
    number.ok_or_else(|| format!("`{text}`: not a number from 0 to {LONGEST_S} s"))
}
