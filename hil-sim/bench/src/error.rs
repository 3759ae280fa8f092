//! The errors of a command, and their exit codes.

use std::io;
use std::path::{Path, PathBuf};

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A name that nothing has.
    #[error("there is no {what} `{}`{}; {list}", cut(.name), did_you_mean(.nearest))]
    Unknown {
        /// Kind of the thing with that name.
        what: &'static str,
        /// The given name.
        name: String,
        /// The most similar name.
        nearest: Option<String>,
        /// Command or place that lists the names.
        list: &'static str,
    },
    /// A value that a key cannot have.
    #[error("{} = {}: {problem}; allowed: {allowed}", cut(.key), cut(.value))]
    Value {
        /// The key.
        key: String,
        /// The given value.
        value: String,
        /// The reason why it is refused.
        problem: &'static str,
        /// The values that are allowed, with their unit.
        allowed: String,
    },
    /// A file that cannot be read, or whose content is not accepted.
    #[error("{}{}: {problem}", .path.display(), line_text(.line))]
    Data {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1; none if the error concerns the whole file.
        line: Option<u64>,
        /// The reason.
        problem: String,
    },
    /// A run that did not end as it should; its results are written.
    #[error("{name}: {reason}")]
    Lost {
        /// The experiment.
        name: String,
        /// The fault, or the other reason.
        reason: String,
    },
    /// Some experiments of a report were refused or failed; the others are in the report.
    #[error("{} of {all} experiments failed: {}", .names.len(), .names.join(", "))]
    Incomplete {
        /// Number of all experiments.
        all: usize,
        /// Names of the failed experiments.
        names: Vec<String>,
    },
    /// Each value is in its range, but a model, a filter or a design rule refuses the combination.
    #[error("{0}")]
    Refused(String),
    /// A file or folder that cannot be written.
    #[error("cannot write {}: {source}", .path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A failure that no input should be able to cause.
    #[error("{0}")]
    Internal(String),
}

impl Error {
    /// Returns the error of a part that refuses its settings.
    pub fn refused(reason: impl std::fmt::Display) -> Self {
        Self::Refused(reason.to_string())
    }

    /// Returns the error of an unknown name of a key, an experiment or a motor.
    pub fn unknown<'a>(
        what: &'static str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> Self {
        let list = match what {
            "key" => "`keys` shows all of them",
            "experiment" => "`list` and `list --lab` show all of them",
            _ => "`motors` shows all of them, and a name that ends in .toml or .json is a file",
        };
        let nearest = nearest(name, known.into_iter()).map(str::to_owned);
        Self::Unknown { what, name: name.to_owned(), nearest, list }
    }

    /// Returns the error of data in a file, on a line or as a whole.
    pub fn data(path: &Path, line: Option<u64>, problem: impl Into<String>) -> Self {
        Self::Data { path: path.to_owned(), line, problem: problem.into() }
    }

    /// Returns the error of a failure to write `path`.
    pub fn write(path: &Path) -> impl FnOnce(io::Error) -> Self + '_ {
        move |source| Self::Write { path: path.to_owned(), source }
    }

    /// Returns the exit code of the process: 2 if the user has to change the request, 1 otherwise.
    pub fn exit_code(&self) -> u8 {
        use Error::{Incomplete, Internal, Lost, Write};
        let failed = matches!(self, Write { .. } | Internal(_) | Lost { .. } | Incomplete { .. });
        if failed { 1 } else { 2 }
    }
}

/// Largest number of characters of an input that a message quotes, and of a message.
const QUOTED: usize = 120;
const MESSAGE: usize = 4000;

/// Returns the beginning of an input, for a message that quotes it.
pub fn cut(text: &str) -> String {
    cut_at(text, QUOTED)
}

fn cut_at(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// Returns a parser's message about an input. Parsers quote the input: a line longer than any parser's own words is cut.
pub fn parser_text(error: impl std::fmt::Display) -> String {
    let line = |line: &str| if line.len() > 3 * QUOTED { cut(line) } else { line.to_owned() };
    error.to_string().trim_end().lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Returns a text that is safe for a terminal: control characters, which an input may contain, are escaped.
pub fn printable(text: &str) -> String {
    let shown = |c: char| !c.is_control() || matches!(c, '\n' | '\t');
    let mut printable = String::with_capacity(text.len());
    for c in text.chars() {
        if shown(c) { printable.push(c) } else { printable.extend(c.escape_debug()) }
    }
    printable
}

/// Returns a message for a terminal: [`printable`], and not longer than a page.
pub fn message(error: impl std::fmt::Display) -> String {
    printable(&cut_at(&error.to_string(), MESSAGE))
}

fn line_text(line: &Option<u64>) -> String {
    line.map(|line| format!(", line {line}")).unwrap_or_default()
}

fn did_you_mean(nearest: &Option<String>) -> String {
    nearest.as_ref().map(|name| format!("; did you mean `{name}`?")).unwrap_or_default()
}

/// Returns the message about a name that is not among the allowed ones.
pub fn unknown(what: &str, name: &str, allowed: &[&str]) -> String {
    let guess = nearest(name, allowed.iter().copied()).map(str::to_owned);
    let (name, allowed) = (cut(name), allowed.join(", "));
    format!("unknown {what} `{name}`{}; allowed: {allowed}", did_you_mean(&guess))
}

/// Returns the name most similar to `name`, regardless of case, if it is similar enough for a misspelling.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    // A longer name is no misspelling, and the comparison would take long.
    known
        .filter(|_| name.len() <= QUOTED)
        .map(|candidate| (strsim::levenshtein(&name.to_lowercase(), candidate), candidate))
        .filter(|&(distance, candidate)| distance <= 2 + candidate.len() / 4)
        .min()
        .map(|(_, candidate)| candidate)
}
