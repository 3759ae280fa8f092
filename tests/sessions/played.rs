//! Plays a session as text for the tests of several packages, each of which includes this file and plays the requests in its own way.

use std::path::Path;
use std::{env, fs};

use hil_sim::sessions::exchanges;

/// Plays the session of a file; returns the first difference from its answers. With `WRITE_SESSIONS` it writes the answers instead.
pub fn difference(
    path: &Path,
    mut play: impl FnMut(&str) -> Result<Vec<String>, String>,
) -> Result<Option<String>, String> {
    let file = path.display();
    let session = fs::read_to_string(path).map_err(|why| format!("{file}: {why}"))?;
    let (mut lines, mut text, mut wrong) = (session.lines(), String::new(), None);
    for exchange in exchanges(&session).map_err(|why| format!("{file}, {why}"))? {
        let place = format!("{file}, line {}: `{}`", exchange.number, exchange.request);
        let said = play(&exchange.request).map_err(|why| format!("{place}: {why}"))?;
        // Up to the request there are comments.
        for line in lines.by_ref() {
            text += &format!("{line}\n");
            if *line == exchange.request {
                break;
            }
        }
        // The written answer is directly behind it.
        lines.by_ref().take(exchange.answer.len()).for_each(drop);
        let difference = exchange.difference(&said);
        let answer = if difference.is_some() { &said } else { &exchange.answer };
        answer.iter().for_each(|line| text += &format!("{line}\n"));
        wrong = wrong.or(difference.map(|why| format!("{place}: {why}")));
    }
    if wrong.is_some() && env::var_os("WRITE_SESSIONS").is_some() {
        lines.for_each(|line| text += &format!("{line}\n"));
        fs::write(path, text).map_err(|why| format!("{file}: {why}"))?;
        return Ok(None);
    }
    Ok(wrong
        .map(|why| format!("{why}\n`WRITE_SESSIONS=1` before the command writes the answers\n")))
}
