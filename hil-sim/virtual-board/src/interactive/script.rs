//! Sessions without a person: the file of `--script` is a session as text, as `tests/sessions/README.md` describes it.
//!
//! ```text
//! # comment
//! > start                 types `start`; the lines below it are the answer that must come within 5 s
//! ok
//! [until: torque]         waits for a line with `torque` of console, log or board, at most 30 s, and for what follows closely
//! [until 2 s: torque]     the same, at most 2 s later
//! [500 ms]                lets time pass
//! >> torque 1             types `torque 1` and goes on at once
//! [reset]                 presses the reset button; so do all commands of [`super::own`], without their `!`
//! [quit]                  ends the session
//! ```
//!
//! A strict script fails at the first answer that is not as written, at the first text that does not come, and if a fault is latched at
//! its end. Where no answer is written, any will do but an error or the report of a fault.

use std::path::Path;

use hil_sim::Error;
use hil_sim::sessions::{Exchange, exchanges, seconds};

use super::own::Own;
use super::transcript::fault;

/// Longest wait for a text, s, if the script states none.
const PATIENCE_S: f64 = 30.0;
/// The question at the end of a strict script, and the beginning of the answer without a fault.
const AT_END: &str = "> faults\n~ none latched";
/// Beginning of the line about a text that does not come.
pub const SILENT: &str = "-> nothing said";
/// Longest time in a script, s: an hour, as for `seconds`.
const LONGEST_S: f64 = 3600.0;

/// Longest wait for an answer, s: more than twice that for the slowest one.
pub(super) const ANSWER_S: f64 = 5.0;

/// A request of a script.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Step {
    /// The line that is typed.
    pub typed: Option<String>,
    /// The command of the board itself.
    pub own: Option<Own>,
    /// Whether the answer to the line ends the step.
    pub asks: bool,
    /// The text after whose lines the step ends. It must come.
    pub until: Option<String>,
    /// Longest duration of the step, s.
    pub within: f64,
}

impl Step {
    /// Parses a request.
    ///
    /// # Errors
    /// It has none of the forms; the error states the reason.
    pub fn parse(request: &str) -> Result<Self, String> {
        if let Some(line) = request.strip_prefix('>') {
            if let Some(own) = Own::parse(line)? {
                return Ok(Self::own(own));
            }
            let typed = line.trim_start_matches('>').trim();
            // An empty line has no answer.
            let asks = !line.starts_with('>') && !typed.is_empty();
            let within = if asks { ANSWER_S } else { 0.0 };
            return Ok(Self { typed: Some(typed.to_owned()), asks, within, ..Self::default() });
        }
        let inner = request.strip_prefix('[').and_then(|inner| inner.strip_suffix(']'));
        let inner = inner.ok_or("write `> LINE` or `[...]`")?;
        let allowed = |time: &str| {
            let seconds = seconds(time).filter(|seconds| *seconds <= LONGEST_S);
            seconds.ok_or_else(|| format!("`{time}`: not a time from 0 s to {LONGEST_S} s"))
        };
        let (word, text) = inner.split_once(": ").unwrap_or((inner, ""));
        if let Some(time) = word.strip_prefix("until") {
            let time = time.trim();
            let within = if time.is_empty() { PATIENCE_S } else { allowed(time)? };
            let text = Some(text.to_owned()).filter(|text| !text.is_empty());
            let until = text.ok_or("write `[until: TEXT]` or `[until 2 s: TEXT]`")?;
            return Ok(Self { until: Some(until), within, ..Self::default() });
        }
        if inner.starts_with(|c: char| c.is_ascii_digit()) {
            return Ok(Self { within: allowed(inner)?, ..Self::default() });
        }
        let own = Own::parse(format!("!{word} {text}").trim())?;
        own.map(Self::own).ok_or_else(|| "no such command".to_owned())
    }

    /// Lasts until the effect of the command is seen. The program filters contacts for some time, so that their effect
    /// belongs to the next step.
    fn own(own: Own) -> Self {
        let within = if matches!(own, Own::Wires(_)) { 0.0 } else { 1e-3 };
        Self { own: Some(own), within, ..Self::default() }
    }
}

/// A script.
#[derive(Clone, Debug)]
pub struct Script {
    /// Its requests with their answers.
    pub lines: Vec<(Step, Exchange)>,
    /// Whether a failure ends it.
    pub strict: bool,
    /// Whether it ends the session.
    pub quits: bool,
}

impl Script {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or a line has none of the forms.
    pub fn open(path: &Path, strict: bool) -> Result<Self, Error> {
        let refused = |why| Error::Refused(format!("--script {}: {why}", path.display()));
        let text = std::fs::read_to_string(path).map_err(|why| refused(why.to_string()))?;
        Self::parse(&text, strict).map_err(refused)
    }

    /// Parses the text of a script. A strict one asks for a latched fault at its end.
    ///
    /// # Errors
    /// The number of the first line with none of the forms, and the reason.
    pub fn parse(text: &str, strict: bool) -> Result<Self, String> {
        let (mut lines, mut quits) = (Vec::new(), false);
        let faults = if strict { AT_END } else { "" };
        for exchange in exchanges(&format!("{}\n{faults}", text.trim_end()))? {
            let Exchange { number, request, .. } = &exchange;
            let step = Step::parse(request);
            let step = step.map_err(|why| format!("line {number}: `{request}`: {why}"))?;
            quits |= step.own == Some(Own::Quit);
            if !quits || faults.starts_with(request) {
                lines.push((step, exchange));
            }
        }
        Ok(Self { lines, strict, quits })
    }
}

/// Returns the reason why an answer is a failure.
pub fn failure(exchange: &Exchange, said: &[String]) -> Option<String> {
    if !exchange.answer.is_empty() {
        return exchange.difference(said);
    }
    let bad = |line: &&String| {
        ["error:", SILENT].iter().any(|begin| line.starts_with(begin)) || fault(line).is_some()
    };
    said.iter().find(bad).map(|line| format!("answered `{line}`"))
}
