//! Transfer of settings from a file to the drive: lines that are sent one by one.

use super::link::Link;
use crate::error::cut;

/// Sends the lines of a text, without empty lines and lines that begin with `#`; returns their number. `progress` gets
/// the number of lines sent so far and the number of all lines.
///
/// # Errors
/// The first line that the drive refuses or does not answer, in words.
pub fn restore(
    link: &mut Link,
    text: &str,
    mut progress: impl FnMut(usize, usize),
) -> Result<usize, String> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let lines: Vec<_> =
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    for (done, (number, line)) in lines.iter().enumerate() {
        progress(done, lines.len());
        let answer = link.ask(line, |_| ()).map_err(|why| format!("line {number}: {why}"))?;
        if let Some(error) = answer.error() {
            return Err(format!(
                "line {number}: `{}`: {error}; {done} lines before it are set",
                cut(line)
            ));
        }
    }
    Ok(lines.len())
}
