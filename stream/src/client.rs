//! Client of the console, without a port and without a thread: bytes for requests, and events from the bytes of the
//! drive.
//!
//! Requests are sent with a tag, `@17 speed 300`, and the last line of an answer repeats it, `@17 ok`. Lines that begin
//! with `* ` are unsolicited and may come at any time. A line of the drive without a tag continues a list, or it is the
//! error of a request that was damaged on its way, so that the drive does not know the tag.

use alloc::borrow::ToOwned as _;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use crate::{Frame, Piece, Splitter};

/// Beginning of the lines that the drive sends unsolicited.
pub const UNASKED: &str = "* ";
/// Longest line that is assembled.
const LONGEST: usize = 4096;

/// Something that the drive has sent.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A frame of a stream; `None` for damaged bytes.
    Frame(Option<Frame>),
    /// A line of the awaited answer; others follow.
    Line(String),
    /// The last line of the awaited answer, without its tag.
    Last(String),
    /// The answer to a later request, which has cut the awaited answer short.
    Cut(String),
    /// An unsolicited line, or the answer to a request that is not awaited.
    Unasked(String),
}

/// The client's state: one request is awaited at a time.
#[derive(Clone, Debug, Default)]
pub struct Client {
    splitter: Splitter,
    /// The line so far, without the sequences that move the cursor of a terminal; and whether it is within one.
    line: Vec<u8>,
    in_sequence: bool,
    /// Tag of the last request.
    tag: u32,
    /// The request that is awaited: its tag, and the line as it was sent.
    awaited: Option<(u32, String)>,
}

impl Client {
    /// Returns the line of a request whose answer is awaited.
    pub fn ask(&mut self, request: &str) -> String {
        let line = self.send(request);
        self.awaited = Some((self.tag, line.clone()));
        line
    }

    /// Returns the line of a request whose answer is not awaited. It cuts a list short that is being answered. An empty
    /// request is a sign of life, which has no answer and interrupts nothing.
    pub fn send(&mut self, request: &str) -> String {
        if request.is_empty() {
            return "\n".to_owned();
        }
        self.tag = self.tag.wrapping_add(1);
        format!("@{:x} {request}\n", self.tag)
    }

    /// Whether an answer is awaited.
    pub fn is_waiting(&self) -> bool {
        self.awaited.is_some()
    }

    /// Stops waiting for the answer.
    pub fn give_up(&mut self) {
        self.awaited = None;
    }

    /// Takes a byte of the drive.
    pub fn push(&mut self, byte: u8) -> Option<Event> {
        match self.splitter.push(byte) {
            Piece::Nothing => None,
            Piece::Frame(frame) => Some(Event::Frame(Some(frame))),
            Piece::Damaged => Some(Event::Frame(None)),
            Piece::Text(byte) => {
                match byte {
                    b'\r' | b'\n' => return self.hear(),
                    _ if self.in_sequence => self.in_sequence = !byte.is_ascii_alphabetic(),
                    // ESC [ parameters letter
                    0x1b => self.in_sequence = true,
                    _ if byte.is_ascii_control() || self.line.len() == LONGEST => {}
                    _ => self.line.push(byte),
                }
                None
            }
        }
    }

    /// Returns the meaning of the line that has ended. Tags count up, and wrap.
    fn hear(&mut self) -> Option<Event> {
        let bytes = core::mem::take(&mut self.line);
        let line = String::from_utf8_lossy(&bytes);
        let line = line.trim_end();
        if line.is_empty() {
            return None;
        }
        let known = split_tag(line)
            .and_then(|(tag, rest)| Some((u32::from_str_radix(tag, 16).ok()?, rest)));
        let text = known.map_or(line, |(_, text)| text).to_owned();
        let Some((awaited, sent)) = &self.awaited else { return Some(Event::Unasked(text)) };
        let is_echo = line.starts_with('@') && sent.starts_with(line);
        let event = match known {
            _ if is_echo => return None,
            _ if line.starts_with(UNASKED) => return Some(Event::Unasked(text)),
            None if !is_error(line) => return Some(Event::Line(text)),
            Some((tag, _)) if tag != *awaited => {
                if awaited.wrapping_sub(tag) < 1 << 31 {
                    return Some(Event::Unasked(text));
                }
                Event::Cut(text)
            }
            _ => Event::Last(text),
        };
        self.awaited = None;
        Some(event)
    }
}

/// Returns the tag of a line and the text after it, if it has one.
pub fn split_tag(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix('@')?.split_once(' ')
}

/// Whether a line refuses a request.
pub fn is_error(line: &str) -> bool {
    line.starts_with("error:")
}

#[cfg(test)]
mod tests {
    use super::Event::{Cut, Last, Line, Unasked};
    use super::*;

    /// A client that awaits the answer to this request with this tag.
    fn asked(tag: u32, request: &str) -> Client {
        let mut client = Client { tag: tag.wrapping_sub(1), ..Client::default() };
        assert_eq!(client.ask(request), format!("@{tag:x} {request}\n"));
        client
    }

    fn heard(mut client: Client, line: &str) -> Option<Event> {
        line.bytes().chain(*b"\r\n").find_map(|byte| client.push(byte))
    }

    #[test]
    fn each_line_has_one_meaning() {
        let text = |event: fn(String) -> Event, text: &str| Some(event(text.to_owned()));
        for (line, expected) in [
            ("@1f faults 4", None),
            ("@1f faul", None),
            ("", None),
            (
                "* fault 4: dc link; likely: the brake; type 'clear'",
                text(Unasked, "* fault 4: dc link; likely: the brake; type 'clear'"),
            ),
            ("fault 4: dc link", text(Line, "fault 4: dc link")),
            ("\x1b[Kcause 1: 25 °C \x07", text(Line, "cause 1: 25 °C")),
            ("ok", text(Line, "ok")),
            ("@1f ok: limited to 3.4 A", text(Last, "ok: limited to 3.4 A")),
            ("@1f error: no such command", text(Last, "error: no such command")),
            ("error: characters were lost", text(Last, "error: characters were lost")),
            ("@1e ok", text(Unasked, "ok")),
            ("@20 ok", text(Cut, "ok")),
            ("@zz ok", text(Line, "@zz ok")),
        ] {
            assert_eq!(heard(asked(0x1f, "faults 4"), line), expected, "{line}");
        }
        assert_eq!(heard(asked(0, "stop"), "@ffffffff ok"), text(Unasked, "ok"));
        assert_eq!(heard(asked(u32::MAX, "stop"), "@0 ok"), text(Cut, "ok"));
        let mut given_up = asked(5, "stop");
        given_up.give_up();
        assert_eq!(heard(given_up, "@5 ok"), text(Unasked, "ok"));
    }
}
