//! Messages between page and board, in the form that `cargo live` uses with its page.

use std::collections::VecDeque;
use std::fmt;

use drive_core::State;
use drive_stream::client::{Client, Event};
use drive_stream::{Frame, MOST_SIGNALS};
use induction_drive::console::handle::Firmware as _;
use serde_json::{Value, json};

use crate::board::HostBoard;
use crate::loops;
use crate::motors::Motor;

/// Time from one question about the drive's state to the next, ms.
const STATUS_MS: u32 = 200;

/// The objects of an answer in JSON Lines.
pub fn objects(lines: &[String]) -> Vec<Value> {
    lines.iter().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// The greeting of the page: the identity of the drive from the answers to `version` and `describe stream`, and why the page does not
/// fit it. The drive in the page itself always fits.
pub fn hello(version: Option<&String>, described: &[Value], misfit: Option<String>) -> Value {
    let signals: Vec<&Value> =
        described.iter().filter(|object| object["signal"].is_string()).collect();
    let [program, project] = [env!("CARGO_PKG_VERSION"), env!("CARGO_PKG_REPOSITORY")];
    json!({ "hello": { "version": version, "program": program, "project": project, "signals": signals, "misfit": misfit } })
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
        let mut bytes = Vec::new();
        for frame in self.waiting.drain(..) {
            let mut values = [f32::NAN; MOST_SIGNALS];
            values.iter_mut().zip(&frame.values).for_each(|(place, value)| *place = *value);
            let head = [frame.period, frame.sequence.into()];
            for word in head.into_iter().chain(values.map(f32::to_bits)) {
                bytes.extend(word.to_le_bytes());
            }
        }
        bytes
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
    client: Client,
    /// Questions; the client awaits the answer to the first.
    asks: VecDeque<(By, String)>,
    /// Messages for the page.
    texts: Vec<Value>,
    frames: Frames,
    since_status_ms: u32,
    /// Whether the drive is before or in its first self-commissioning, and whether it has left the state off.
    begins: bool,
    has_begun: bool,
}

impl Talk {
    /// A conversation with a board that has just been powered up.
    pub fn new(mut board: HostBoard) -> Self {
        let mut client = Client::default();
        board.write(client.send("baud 2000000").as_bytes());
        Self {
            board,
            client,
            asks: VecDeque::from([(By::Hello, "describe stream".to_owned())]),
            texts: Vec::new(),
            frames: Frames::default(),
            since_status_ms: 0,
            begins: false,
            has_begun: false,
        }
    }

    /// A conversation with a board that begins to learn the motor of this name. Equal seeds give equal bits.
    ///
    /// # Errors
    /// As [`Motor::named`] and [`HostBoard::new`].
    pub fn learning(motor: &str, seed: u64) -> Result<Self, String> {
        let mut talk = Self::new(HostBoard::new(&Motor::named(motor)?, seed)?);
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
        self.board.write(self.client.send("stop").as_bytes());
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
            if !self.client.is_waiting() {
                if self.asks.is_empty() && self.since_status_ms >= STATUS_MS {
                    self.asks.push_back((By::Status, "status".to_owned()));
                    self.since_status_ms = 0;
                }
                if let Some((_, line)) = self.asks.front() {
                    self.board.write(self.client.ask(line).as_bytes());
                }
            }
            self.board.millisecond();
            let is_off = self.board.machine.drive().is_off();
            self.begins &= !(is_off && self.has_begun);
            self.has_begun |= !is_off;
            for byte in self.board.read() {
                match self.client.push(byte) {
                    Some(Event::Frame(frame)) => self.frames.push(frame),
                    Some(Event::Answer(answer)) => self.answered(answer.lines),
                    Some(Event::Cut(line)) => {
                        self.show(&line);
                        let why = "error: cut short by the stop";
                        self.answered(vec![why.to_owned()]);
                    }
                    Some(Event::Unasked(line)) => self.show(&line),
                    Some(Event::Line(_)) | None => {}
                }
            }
        }
    }

    fn show(&mut self, line: &str) {
        self.texts.push(json!({ "line": line }));
    }

    fn answered(&mut self, lines: Vec<String>) {
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
                let mut said = hello(Some(&version), &objects(&lines), None);
                let motors: Vec<_> = Motor::all().map(|motor| [motor.name, motor.title]).collect();
                said["hello"]["motors"] = json!(motors);
                said["hello"]["dc_link_v"] = self.board.healthy.inverter.vdc.into();
                self.texts.push(said);
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
