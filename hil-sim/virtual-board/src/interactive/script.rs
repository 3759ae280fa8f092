//! Sessions without a person: the file of `--script` is a session as text, as `tests/sessions/README.md` describes it.
//!
//! ```text
//! # comment
//! > start                 types `start`; the lines below it are the answer that must come within 5 s
//! ok
//! [until: torque]         goes on when console, log or board have said a line with `torque`, at most 30 s later
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
const AT_END: [&str; 2] = ["> faults", "~ none latched"];
/// Beginning of the line about a text that does not come.
pub const SILENT: &str = "-> nothing said";
/// Longest time in a script, s: an hour, as for `seconds`.
const LONGEST_S: f64 = 3600.0;

/// A request of a script.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Types a line, and waits for its answer.
    Ask(String),
    /// Types a line.
    Type(String),
    /// A command of the board itself.
    Own(Own),
    /// Lets time pass, s.
    Pass(f64),
    /// Waits until a line with this text has come, for at most this time, s.
    Until(f64, String),
}

impl Step {
    /// Parses a request.
    ///
    /// # Errors
    /// It has none of the forms; the error states the reason.
    pub fn parse(request: &str) -> Result<Self, String> {
        if let Some(line) = request.strip_prefix(">>") {
            return Ok(Self::Type(line.trim().to_owned()));
        }
        if let Some(line) = request.strip_prefix('>') {
            let own = Own::parse(line)?.map(Self::Own);
            return Ok(own.unwrap_or_else(|| Self::Ask(line.trim().to_owned())));
        }
        let inner = request.strip_prefix('[').and_then(|inner| inner.strip_suffix(']'));
        let inner = inner.ok_or("write `> LINE` or `[...]`")?;
        let allowed = |time: &str| {
            let seconds = seconds(time).filter(|seconds| *seconds <= LONGEST_S);
            seconds.ok_or_else(|| format!("`{time}`: not a time from 0 s to {LONGEST_S} s"))
        };
        let (word, text) = inner.split_once(": ").unwrap_or((inner, ""));
        match word.strip_prefix("until") {
            Some(_) if text.is_empty() => {
                Err("write `[until: TEXT]` or `[until 2 s: TEXT]`".into())
            }
            Some("") => Ok(Self::Until(PATIENCE_S, text.to_owned())),
            Some(time) => Ok(Self::Until(allowed(time.trim())?, text.to_owned())),
            None if inner.starts_with(|c: char| c.is_ascii_digit()) => {
                Ok(Self::Pass(allowed(inner)?))
            }
            None => {
                let own = Own::parse(format!("!{word} {text}").trim())?;
                own.map(Self::Own).ok_or_else(|| "no such command".to_owned())
            }
        }
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
        let parsed =
            exchanges(text)?.into_iter().map(|exchange| match Step::parse(&exchange.request) {
                Ok(step) => Ok((step, exchange)),
                Err(why) => Err(format!("line {}: `{}`: {why}", exchange.number, exchange.request)),
            });
        let mut lines = parsed.collect::<Result<Vec<_>, String>>()?;
        let quit = lines.iter().position(|(step, _)| *step == Step::Own(Own::Quit));
        lines.truncate(quit.unwrap_or(lines.len()));
        if strict {
            let (request, answer) = AT_END.map(str::to_owned).into();
            let number = text.lines().count() + 1;
            lines
                .push((Step::parse(&request)?, Exchange { number, request, answer: vec![answer] }));
        }
        Ok(Self { lines, strict, quits: quit.is_some() })
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
