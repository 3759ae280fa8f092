//! Messages between page and board, in the form that `cargo live` uses with its page.

use std::collections::VecDeque;
use std::fmt;

use drive_core::State;
use drive_stream::{Frame, MOST_SIGNALS, Piece, Splitter};
use induction_drive::console::handle::Firmware as _;
use serde_json::{Value, json};

use crate::board::HostBoard;
use crate::loops;

/// Time from one question about the drive's state to the next, ms.
const STATUS_MS: u32 = 200;
/// Layout of a frame that the page understands.
const LAYOUT: [&str; 4] = ["u16 sequence", "u32 period", "f32 per signal", "u16 crc"];

/// The greeting of the page, from the answers to `version` and `describe stream`: the identity of the drive, and whether the page fits
/// it.
pub fn hello(version: Option<&String>, described: &[String]) -> Value {
    let objects: Vec<Value> =
        described.iter().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let signals: Vec<&Value> =
        objects.iter().filter(|object| object["signal"].is_string()).collect();
    let error = described.last().filter(|line| line.starts_with("error:"));
    let fits = objects.iter().any(|object| object["frame"] == json!(LAYOUT));
    let misfit = match error {
        Some(error) => Some(format!(
            "This firmware is older than the page: it has no live curves ({error}). Everything else works as far as the firmware \
             knows it. To update it: cargo xtask flash."
        )),
        None => (!fits).then(|| {
            "This firmware sends its curves in a layout that the page does not know. To update the page: git pull.".to_owned()
        }),
    };
    let program = env!("CARGO_PKG_VERSION");
    json!({ "hello": { "version": version, "program": program, "signals": signals, "misfit": misfit } })
}

fn words(frame: &Frame) -> impl Iterator<Item = u8> + use<> {
    let mut values = [f32::NAN; MOST_SIGNALS];
    values.iter_mut().zip(&frame.values).for_each(|(place, value)| *place = *value);
    let head = [frame.period, frame.sequence.into()];
    head.into_iter().chain(values.map(f32::to_bits)).flat_map(u32::to_le_bytes)
}

/// Most frames that wait for a slow page; the oldest are dropped first.
const MOST_FRAMES: usize = 6000;

/// The frames of a stream on their way to the page.
#[derive(Default)]
pub struct Frames {
    waiting: VecDeque<Frame>,
    /// Frames received; missing between these, dropped by the firmware or damaged; damaged on the wire; not taken by a slow page.
    pub counts: [u64; 4],
    next: Option<u16>,
}

impl Frames {
    /// Takes a frame of the drive; `None` for damaged bytes.
    pub fn push(&mut self, frame: Option<Frame>) {
        let [received, missing, damaged, skipped] = &mut self.counts;
        let Some(frame) = frame else { return *damaged += 1 };
        *missing += u64::from(frame.sequence.wrapping_sub(self.next.unwrap_or(frame.sequence)));
        *received += 1;
        self.next = Some(frame.sequence.wrapping_add(1));
        if self.waiting.len() >= MOST_FRAMES {
            self.waiting.pop_front();
            *skipped += 1;
        }
        self.waiting.push_back(frame);
    }

    /// Returns the waiting frames, each as ten little-endian words: period, sequence number, values.
    pub fn take(&mut self) -> Vec<u8> {
        self.waiting.drain(..).flat_map(|frame| words(&frame)).collect()
    }
}

/// Source of a question to the drive.
enum By {
    /// The page, with a number for the answer.
    Page(u32),
    /// This program, for the state.
    Status,
    /// This program, for the greeting.
    Hello,
}

/// Conversation of a page with a board in the same program.
pub struct Talk {
    /// The board.
    pub board: HostBoard,
    /// Questions, of which the first has been sent. The next field holds the lines of its answer so far.
    asks: VecDeque<(By, String)>,
    lines: Vec<String>,
    /// Number of the last question that was sent. The next field says whether it is still unanswered.
    tag: u32,
    awaited: bool,
    splitter: Splitter,
    line: Vec<u8>,
    /// Messages for the page.
    texts: Vec<Value>,
    frames: Frames,
    since_status_ms: u32,
    /// Whether the drive is before or in its first self-commissioning.
    begins: bool,
}

impl Talk {
    /// A conversation with a board that has just been powered up.
    pub fn new(mut board: HostBoard) -> Self {
        board.write(b"@0 baud 2000000\n");
        Self {
            board,
            asks: VecDeque::from([(By::Hello, "describe stream".to_owned())]),
            lines: Vec::new(),
            tag: 0,
            awaited: false,
            splitter: Splitter::new(),
            line: Vec::new(),
            texts: Vec::new(),
            frames: Frames::default(),
            since_status_ms: 0,
            begins: false,
        }
    }

    /// A conversation with a board that begins to learn its motor. Equal seeds give equal bits.
    ///
    /// # Errors
    /// As [`HostBoard::new`].
    pub fn learning(seed: u64) -> Result<Self, String> {
        let mut talk = Self::new(HostBoard::new(seed)?);
        talk.ask(0, "learn");
        talk.begins = true;
        Ok(talk)
    }

    /// Queues a line of the page for the board; its answer gets this number.
    pub fn ask(&mut self, number: u32, line: &str) {
        self.asks.push_back((By::Page(number), line.replace(['\r', '\n'], " ")));
    }

    /// Stops the drive, ahead of all waiting lines.
    pub fn stop(&mut self) {
        self.begins = false;
        self.texts.push(json!({ "stopped": "by the page" }));
        self.board.write(b"@0 stop\n");
        // The stop has cut a list short, whose end does not come.
        if self.awaited {
            self.answered(vec!["error: cut short by the stop".to_owned()]);
        }
    }

    /// Whether the simulation should run as fast as possible, because the drive is in a phase that is not worth waiting for.
    pub fn hurries(&self) -> bool {
        // The page gets its first picture before that.
        self.begins && self.frames.counts[0] > 0
            || self.board.machine.drive().state() == State::Learning
    }

    /// Simulates this number of milliseconds.
    pub fn advance(&mut self, ms: u32) {
        for _ in 0..ms {
            self.since_status_ms += 1;
            if !self.awaited {
                if self.asks.is_empty() && self.since_status_ms >= STATUS_MS {
                    self.asks.push_back((By::Status, "status".to_owned()));
                    self.since_status_ms = 0;
                }
                if let Some((_, line)) = self.asks.front() {
                    self.tag = self.tag % 0xffff + 1;
                    self.awaited = true;
                    self.board.write(format!("@{:x} {line}\n", self.tag).as_bytes());
                }
            }
            self.board.millisecond();
            for byte in self.board.read() {
                match self.splitter.push(byte) {
                    Piece::Text(b'\n') => {
                        let line = std::mem::take(&mut self.line);
                        self.hear(String::from_utf8_lossy(&line).trim_end());
                    }
                    Piece::Text(byte) => self.line.push(byte),
                    Piece::Frame(frame) => self.frames.push(Some(frame)),
                    Piece::Damaged => self.frames.push(None),
                    Piece::Nothing => {}
                }
            }
        }
    }

    fn hear(&mut self, line: &str) {
        if line.starts_with("* ") {
            self.begins &=
                !["* off", "* fault", "* stopped"].iter().any(|end| line.starts_with(end));
            self.texts.push(json!({ "line": line }));
            return;
        }
        match line.strip_prefix('@').and_then(|rest| rest.split_once(' ')) {
            None => self.lines.push(line.to_owned()),
            Some((tag, rest)) if self.awaited && tag == format!("{:x}", self.tag) => {
                let mut lines = std::mem::take(&mut self.lines);
                lines.push(rest.to_owned());
                self.answered(lines);
            }
            // The answer to a stop, or to a question that a stop has cut short.
            Some((_, rest)) => self.texts.push(json!({ "line": rest })),
        }
    }

    fn answered(&mut self, lines: Vec<String>) {
        self.awaited = false;
        self.lines.clear();
        let Some((by, line)) = self.asks.pop_front() else { return };
        match by {
            By::Page(number) => {
                let loops = (line == "describe").then(|| loops::of(&lines));
                if line.starts_with("stream ") {
                    self.frames = Frames::default();
                }
                self.texts.push(json!({ "id": number, "lines": lines, "loops": loops }));
            }
            By::Status => self.texts.push(json!({ "status": lines.last() })),
            By::Hello => {
                let version = fmt::from_fn(|f| self.board.machine.version(f)).to_string();
                self.texts.push(hello(Some(&version), &lines));
            }
        }
    }

    /// Returns the messages for the page as JSON, and the [frames](Frames::take). The page reads the messages first: the answer to a new
    /// stream describes its frames.
    pub fn take(&mut self) -> (String, Vec<u8>) {
        let mut texts = std::mem::take(&mut self.texts);
        texts.push(json!({ "tick": self.frames.counts, "flux": self.board.machine.flux() }));
        (Value::from(texts).to_string(), self.frames.take())
    }
}
