//! The connection to the drive: questions of the page one after the other, the drive's state between them, and a sign of life as long as
//! the page is connected.

use std::sync::Arc;
use std::time::{Duration, Instant};

use drive_stream::client::Answer;
use drive_web::{loops, talk};
use hil_sim::console::link::{Link, LinkError, is_off};
use serde_json::{Value, json};

use crate::shared::{Ask, Shared};

/// Time from one question about the drive's state to the next.
const STATUS: Duration = Duration::from_millis(200);
/// Time from one sign of life to the next.
const SIGN_OF_LIFE: Duration = Duration::from_millis(100);
/// Time without a line after which the firmware stops the drive, s.
const ALIVE_S: f64 = 0.4;
/// Time from one attempt to open the port to the next.
const RETRY: Duration = Duration::from_secs(1);
/// Layout of a frame that the page understands.
const LAYOUT: [&str; 4] = ["u16 sequence", "u32 period", "f32 per signal", "u16 crc"];
/// Longest line that the console takes.
const LONGEST: usize = 120;

/// A line of the page that may go to the console.
///
/// # Errors
/// The reason why it may not.
pub fn checked(line: &str) -> Result<String, String> {
    let line = line.trim();
    let word = line.split_whitespace().next().unwrap_or_default().to_ascii_lowercase();
    if line.is_empty() || line.len() > LONGEST || !line.bytes().all(|b| (b' '..=b'~').contains(&b))
    {
        return Err(format!(
            "a line has 1 to {LONGEST} printable characters, this has {}",
            line.len()
        ));
    }
    match word.as_str() {
        "baud" => Err("`baud` is sent by this program itself".to_owned()),
        // The time after which the firmware stops the drive if this program no longer sends is added.
        "stream" if line.contains(' ') => Ok(format!("{line} alive {ALIVE_S}")),
        _ => Ok(line.to_owned()),
    }
}

/// Sends signs of life while the page is connected, and stops the drive when the page is lost. Never returns.
pub fn watch(shared: &Shared) {
    loop {
        if shared.page_is_alive() {
            if shared.drive_listens() {
                shared.send("");
            }
        } else if shared.page_was_lost() {
            shared.stop("the page was closed, or did not answer");
        }
        std::thread::sleep(SIGN_OF_LIFE / 2);
    }
}

/// Connects again and again, and answers the questions meanwhile. Never returns.
pub fn run(shared: &Arc<Shared>, mut connect: impl FnMut(&Arc<Shared>) -> Result<Link, String>) {
    loop {
        match connect(shared) {
            Ok(mut link) => {
                link.begin();
                shared.connect(Some(link.urgent()));
                shared.heard();
                hello(shared, &mut link);
                converse(shared, &mut link);
                shared.connect(None);
                shared.tell(json!({ "gone": "the connection to the drive is lost" }));
            }
            Err(why) => shared.tell(json!({ "gone": why })),
        }
        std::thread::sleep(RETRY);
        shared.drop_asks("the drive is not connected");
    }
}

/// Answers questions until the port is closed.
fn converse(shared: &Shared, link: &mut Link) {
    let mut asked = Instant::now();
    while !link.is_closed() {
        match shared.next_ask(STATUS.saturating_sub(asked.elapsed())) {
            Some(Ask::Hello) => hello(shared, link),
            Some(Ask::Line(id, line)) => {
                let answer = match link.ask(&line, |_| ()) {
                    Ok(Answer { lines }) => {
                        let loops = (line == "describe").then(|| loops::of(&lines));
                        json!({ "id": id, "lines": lines, "loops": loops })
                    }
                    Err(why) => json!({ "id": id, "error": why.to_string() }),
                };
                // The frames of the stream come after the answer.
                if line.starts_with("stream ") {
                    shared.new_stream();
                }
                shared.heard();
                shared.tell(answer);
            }
            None => {}
        }
        if asked.elapsed() >= STATUS {
            asked = Instant::now();
            match link.ask("status", |_| ()) {
                Ok(answer) => show_status(shared, answer.last()),
                // The drive was reset, or has another rate: the caller connects again.
                Err(LinkError::Silence(..)) => return,
                Err(_) => {}
            }
        }
    }
}

fn show_status(shared: &Shared, status: &str) {
    shared.heard();
    // A drive that is stopping takes another `stop`.
    if !is_off(status) && shared.is_abandoned() {
        shared.send("stop");
    }
    shared.tell(json!({ "status": status }));
}

/// Returns the reason why the page does not fit a drive that answers `describe stream` with this error, or with these objects.
fn misfit(error: Option<&str>, described: &[Value]) -> Option<String> {
    match error {
        Some(error) => Some(format!(
            "This firmware is older than the page: it has no live curves ({error}). Everything else works as far as the firmware \
             knows it. To update it: cargo xtask flash."
        )),
        None if described.iter().any(|object| object["frame"] == json!(LAYOUT)) => None,
        None => Some(
            "This firmware sends its curves in a layout that the page does not know. To update the page: git pull.".to_owned(),
        ),
    }
}

/// Tells the page which drive this is, and whether this program understands it.
fn hello(shared: &Shared, link: &mut Link) {
    let mut ask = |line: &str| link.ask(line, |_| ());
    match (ask("version"), ask("describe stream")) {
        (Ok(version), Ok(described)) => {
            let objects = talk::objects(&described.lines);
            let misfit = misfit(described.error(), &objects);
            shared.tell(talk::hello(version.lines.last(), &objects, misfit));
        }
        (Err(why), _) | (_, Err(why)) => {
            shared.tell(json!({ "gone": format!("the drive does not answer: {why}") }));
        }
    }
}
