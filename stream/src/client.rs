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

/// The answer to a request.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// The lines of the answer, the last one without its tag.
    pub lines: Vec<String>,
}

impl Answer {
    /// Returns the last line.
    pub fn last(&self) -> &str {
        self.lines.last().map_or("", String::as_str)
    }

    /// Returns the line that refuses the request.
    pub fn error(&self) -> Option<&str> {
        Some(self.last()).filter(|line| is_error(line))
    }

    /// Returns the lines without an `ok` at the end.
    pub fn contents(&self) -> &[String] {
        match self.lines.split_last() {
            Some((last, before)) if last == "ok" => before,
            _ => &self.lines,
        }
    }
}

/// Something that the drive has sent.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A frame of a stream; `None` for damaged bytes.
    Frame(Option<Frame>),
    /// A line of the awaited answer; others follow.
    Line(String),
    /// The whole awaited answer.
    Answer(Answer),
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
    /// The request that is awaited: its tag, and the line as it was sent. The next field holds its answer so far.
    awaited: Option<(u32, String)>,
    answer: Answer,
}

impl Client {
    /// Returns the line of a request whose answer is awaited.
    pub fn ask(&mut self, request: &str) -> String {
        let line = self.send(request);
        self.awaited = Some((self.tag, line.clone()));
        self.answer.lines.clear();
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
        let event = match known {
            _ if sent.starts_with(line) => return None,
            _ if line.starts_with(UNASKED) => return Some(Event::Unasked(text)),
            None if !is_error(line) => {
                self.answer.lines.push(text.clone());
                return Some(Event::Line(text));
            }
            Some((tag, _)) if tag != *awaited => {
                if awaited.wrapping_sub(tag) < 1 << 31 {
                    return Some(Event::Unasked(text));
                }
                Event::Cut(text)
            }
            _ => {
                self.answer.lines.push(text);
                Event::Answer(core::mem::take(&mut self.answer))
            }
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
fn is_error(line: &str) -> bool {
    line.starts_with("error:")
}

#[cfg(test)]
mod tests {
    use super::Event::{Cut, Line, Unasked};
    use super::*;

    /// A client that awaits the answer to this request with this tag.
    fn asked(tag: u32, request: &str) -> Client {
        let mut client = Client { tag: tag.wrapping_sub(1), ..Client::default() };
        assert_eq!(client.ask(request), format!("@{tag:x} {request}\n"));
        client
    }

    /// Events of lines, in words.
    fn heard(client: &mut Client, lines: &[&str]) -> Vec<String> {
        let bytes = lines.iter().flat_map(|line| line.bytes().chain(*b"\r\n"));
        let events = bytes.filter_map(|byte| client.push(byte));
        let words = events.map(|event| match event {
            Line(line) => format!("line {line}"),
            Event::Answer(answer) => format!("answer {}", answer.lines.join("|")),
            Cut(line) => format!("cut {line}"),
            Unasked(line) => format!("unasked {line}"),
            Event::Frame(_) => "frame".to_owned(),
        });
        words.collect()
    }

    #[test]
    fn each_line_has_one_meaning() {
        for (line, expected) in [
            ("@1f faults 4", ""),
            ("@1f faul", ""),
            ("", ""),
            ("* fault 4: dc link; likely: x", "unasked * fault 4: dc link; likely: x"),
            ("fault 4: dc link", "line fault 4: dc link"),
            ("off: y", "line off: y"),
            ("\x1b[Kcause 1: 25 °C \x07", "line cause 1: 25 °C"),
            ("ok", "line ok"),
            ("@1f ok: limited to 3.4 A", "answer ok: limited to 3.4 A"),
            ("@1f error: no such command", "answer error: no such command"),
            ("error: characters were lost", "answer error: characters were lost"),
            ("@1e ok", "unasked ok"),
            ("@20 ok", "cut ok"),
            ("@zz ok", "line @zz ok"),
        ] {
            let expected: Vec<_> = [expected].into_iter().filter(|text| !text.is_empty()).collect();
            assert_eq!(heard(&mut asked(0x1f, "faults 4"), &[line]), expected, "{line}");
        }
        assert_eq!(heard(&mut asked(0, "stop"), &["@ffffffff ok"]), ["unasked ok"]);
        assert_eq!(heard(&mut asked(u32::MAX, "stop"), &["@0 ok"]), ["cut ok"]);
        let mut given_up = asked(5, "stop");
        given_up.give_up();
        assert_eq!(heard(&mut given_up, &["@5 ok"]), ["unasked ok"]);
    }

    /// The answer to an urgent line is no answer to the next request, and the rest of a list that was cut short belongs to no answer.
    #[test]
    fn answers_are_those_of_their_requests() {
        let mut client = Client::default();
        assert_eq!([client.send("stop"), client.send("")], ["@1 stop\n", "\n"]);
        client.ask("status");
        let lines = ["@1 ok", "* running: torque", "@2 off; dc link 311 V"];
        let told = ["unasked ok", "unasked * running: torque", "answer off; dc link 311 V"];
        assert_eq!(heard(&mut client, &lines), told);
        assert!(!client.is_waiting());
        client.ask("help");
        assert_eq!(heard(&mut client, &["a  b", "c  d"]), ["line a  b", "line c  d"]);
        client.send("stop");
        assert_eq!(heard(&mut client, &["@4 ok", "e  f"]), ["cut ok", "unasked e  f"]);
        client.ask("help");
        let whole = ["line a  b", "line ok", "answer a  b|ok|ok"];
        assert_eq!(heard(&mut client, &["a  b", "ok", "@5 ok"]), whole);
    }

    #[test]
    fn the_last_line_of_an_answer_tells_whether_the_request_is_refused() {
        for (lines, error, contents) in [
            (&["off; x"][..], None, 1),
            (&["a", "ok"], None, 1),
            (&["a", "error: b"], Some("error: b"), 2),
            (&["error: a", "ok"], None, 1),
            (&[], None, 0),
        ] {
            let answer = Answer { lines: lines.iter().map(|line| (*line).to_owned()).collect() };
            assert_eq!((answer.error(), answer.contents().len()), (error, contents), "{lines:?}");
        }
    }
}
