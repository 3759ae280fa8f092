//! Settings to and from a file: lines that are sent one by one.

use super::answer::is_unknown_command;
use super::link::{Answer, Link, LinkError};

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

/// The lines that restore the present settings: those of the drive's `backup`; for a firmware without it, a `set` for
/// every line of `get`.
///
/// # Errors
/// The drive does not answer. The inner one is the answer of a drive that refuses.
pub fn backup(link: &mut Link) -> Result<Result<Vec<String>, String>, LinkError> {
    let answer = link.ask("backup", |_| ())?;
    match answer.error() {
        None => return Ok(Ok(answer.contents().to_vec())),
        Some(error) if !is_unknown_command(error) => return Ok(Err(error.to_owned())),
        Some(_) => {}
    }
    let answer = link.ask("get", |_| ())?;
    Ok(match answer.error() {
        Some(error) => Err(error.to_owned()),
        None => Ok(set_lines(&answer)),
    })
}

/// `set NAME VALUE` for every line `NAME = VALUE UNIT (RANGE)`; a value by rule reads `auto: NUMBER`.
fn set_lines(settings: &Answer) -> Vec<String> {
    let parts = settings.contents().iter().filter_map(|line| line.split_once(" = "));
    let values = parts.filter_map(|(name, rest)| Some((name, rest.split_whitespace().next()?)));
    values.map(|(name, value)| format!("set {name} {}", value.trim_end_matches(':'))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_become_lines_that_set_them() {
        let lines = [
            "motor.r_s = 5.4 ohm (0.001 to 1000)",
            "sequence.i_d = auto: 0.7 A (0 to 3)",
            "angle_source = injection (one of: encoder injection)",
            "motor.pole_pairs = 2 (1 to 50)",
            "ok",
        ];
        let answer = Answer { lines: lines.map(str::to_owned).to_vec() };
        assert_eq!(
            set_lines(&answer),
            [
                "set motor.r_s 5.4",
                "set sequence.i_d auto",
                "set angle_source injection",
                "set motor.pole_pairs 2"
            ]
        );
    }
}
