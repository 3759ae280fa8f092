//! Settings to and from a file: lines that are sent one by one.

use super::link::{Link, LinkError};

/// Why a restore has stopped.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// The drive refuses a line.
    #[error("line {number}: `{line}`: {answer}; {} lines before it are set", .done)]
    Refused {
        /// Number of the line in the file.
        number: usize,
        /// The line.
        line: String,
        /// The drive's answer.
        answer: String,
        /// Lines that the drive has taken.
        done: usize,
    },
    /// The drive does not answer.
    #[error("line {0}: {1}")]
    Link(usize, LinkError),
}

/// The lines that restore the present settings: those of the drive's `backup`.
///
/// # Errors
/// The drive does not answer. The inner one is the answer of a drive that refuses.
pub fn backup(link: &mut Link) -> Result<Result<Vec<String>, String>, LinkError> {
    let answer = link.ask("backup", |_| ())?;
    Ok(match answer.error() {
        Some(error) => Err(error.to_owned()),
        None => Ok(answer.contents().to_vec()),
    })
}

/// Sends the lines of a text, without empty ones and those that begin with `#`; returns their number. `progress` gets
/// the number of lines sent so far and that of all.
///
/// # Errors
/// The first line that the drive refuses.
pub fn restore(
    link: &mut Link,
    text: &str,
    mut progress: impl FnMut(usize, usize),
) -> Result<usize, RestoreError> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let lines: Vec<_> =
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    for (done, (number, line)) in lines.iter().enumerate() {
        progress(done, lines.len());
        let answer = link.ask(line, |_| ()).map_err(|why| RestoreError::Link(*number, why))?;
        if let Some(error) = answer.error() {
            let (line, answer) = ((*line).to_owned(), error.to_owned());
            return Err(RestoreError::Refused { number: *number, line, answer, done });
        }
    }
    Ok(lines.len())
}
