//! Transfer of settings from a file to the drive: lines that are sent one by one.

use super::link::Link;
use crate::error::cut;

/// Most refused lines that are listed; a file with more of them is no backup for this drive.
const MOST_REFUSED: usize = 20;

/// The choice that the user has.
const DECIDE: &str = "the other lines are staged, and the drive does not start: `apply rest` puts them in force, `revert` drops them";

/// Sends the lines of a text as a backup, without empty lines and lines that begin with `#`; returns their number. Lines that the drive
/// refuses are left out, and it starts only when the user has decided about the others. `progress` gets the number of lines sent so far and
/// the number of all lines.
///
/// # Errors
/// The lines that the drive refuses, or the one that it does not answer, in words.
pub fn restore(
    link: &mut Link,
    text: &str,
    mut progress: impl FnMut(usize, usize),
) -> Result<usize, String> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let lines: Vec<_> =
        lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')).collect();
    begin(link)?;
    let mut refused = Vec::new();
    for (done, (number, line)) in lines.iter().enumerate() {
        progress(done, lines.len());
        // Refused as well, until the user has decided.
        if *line == "apply" && !refused.is_empty() {
            continue;
        }
        let answer = link.ask(line, |_| ()).map_err(|why| format!("line {number}: {why}"))?;
        if let Some(error) = answer.error() {
            refused.push(format!("line {number}: `{}`: {error}", cut(line)));
        }
        if refused.len() > MOST_REFUSED {
            link.ask("revert", |_| ()).map_err(|why| why.to_string())?;
            refused.push("this is no backup for this drive: all its lines are dropped".to_owned());
            return Err(refused.join("\n"));
        }
    }
    if refused.is_empty() {
        return Ok(lines.len());
    }
    refused.push(DECIDE.to_owned());
    Err(refused.join("\n"))
}

/// Tells the drive that the next lines are a backup, also if they do not name its board.
fn begin(link: &mut Link) -> Result<(), String> {
    let answer = link.ask("board", |_| ()).map_err(|why| why.to_string())?;
    let lines = answer.contents();
    let first = lines.first().and_then(|line| line.split(':').next());
    link.ask(first.ok_or("the drive does not name its board")?, |_| ())
        .map_err(|why| why.to_string())
        .map(drop)
}
