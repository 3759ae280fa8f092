//! The console: one line in, one line out, for people and for scripts.
//!
//! Replies begin with `ok` or `error:`, except for requests of data. Some requests answer with many lines and end with
//! `ok`; the next line that comes in cuts them short. An invalid line changes nothing.
//!
//! A request may carry a tag, `@17 speed 300`; the last line of its answer repeats it, `@17 ok`. Unrequested lines (faults, changes of
//! state, progress) begin with [`line::UNASKED`], which begins no answer and no request.

mod announce;
mod answer;
pub mod baud;
mod board;
pub mod grammar;
pub mod handle;
pub mod line;
mod list;
mod number;
#[cfg(target_os = "none")]
mod port;
mod reply;
pub mod restore;
mod status;
mod stream;
mod suggest;
#[cfg(test)]
pub(crate) mod tests;
pub mod words;

use core::fmt;

use crate::commissioning::News;
use crate::desk::Desk;
use crate::recording::trace::Plan;
use crate::settings::Commander;
use crate::settings::staging::Applied;
use grammar::ParseError;
use handle::{Firmware, Port};
use line::{LineError, LineReader, OutputLine};
use list::List;
#[cfg(target_os = "none")]
pub use port::Lpuart;
use restore::Restore;
use stream::Wire;

/// Longest time from the first character of a line to its end, ms: a slow typist.
pub const LINE_MS: u32 = 30_000;

/// The console.
#[derive(Default)]
pub struct Console {
    reader: LineReader,
    /// Text that waits for space in the transmit queue.
    out: OutputLine,
    list: Option<List>,
    /// Start of the incoming line.
    began_ms: Option<u32>,
    /// Time of the last valid line; `None` restarts the time.
    line_ms: Option<u32>,
    /// Number of the arbiter's last design that was noticed.
    designs: u8,
    /// The last trace.
    traced: Option<Plan>,
    /// Whether the trace waits for its trigger.
    armed: bool,
    /// Event of the commissioning, and the number of the next line about it.
    commissioned: Option<(News, usize)>,
    restore: Restore,
    /// The stream, and the rate of the port.
    wire: Wire,
}

/// Most bytes read in one poll: a flood must not hold up the main loop.
const BYTES_AT_ONCE: usize = 64;

impl Console {
    /// Writes the version and the end of the last run.
    pub fn greet(&mut self, drive: &impl Firmware) {
        let (version, last_run) =
            (fmt::from_fn(|f| drive.version(f)), fmt::from_fn(|f| drive.last_run(f)));
        self.out.news(format_args!("induction-drive {version}; last run: {last_run}"));
    }

    /// Whether no text waits.
    pub fn has_said_all(&self) -> bool {
        self.out.as_str().is_empty()
    }

    /// Reads received bytes and writes replies; never waits. `now_ms` wraps.
    #[inline(never)] // its stack does not add to that of a design
    pub fn poll(
        &mut self,
        port: &mut impl Port,
        desk: &mut Desk,
        drive: &mut impl Firmware,
        now_ms: u32,
    ) {
        if port.take_damage() {
            self.reader.spoil(LineError::Lost);
        }
        // The time that a design takes does not count as silence.
        if desk.has_designed(&mut self.designs) {
            self.line_ms = None;
        }
        if self.flushed(port)
            && let Some((applied, answer)) = desk.done.take()
        {
            if applied != Applied::default() {
                self.out.news(format_args!("applied{applied}"));
            }
            self.reply(&answer);
        }
        if self.flushed(port) {
            self.announce(desk, drive, now_ms);
        }
        for _ in 0..BYTES_AT_ONCE {
            if !self.flushed(port) || desk.is_busy() {
                return;
            }
            let Some(byte) = port.read() else { break };
            self.take(byte, desk, drive, now_ms);
        }
        // The watches come after the received bytes: the main loop may have designed for seconds.
        self.watch_link(desk, drive, now_ms);
        self.watch_rate(port, drive, now_ms);
        match self.began_ms {
            Some(_) if !self.reader.begun() => self.began_ms = None,
            Some(began) if now_ms.wrapping_sub(began) > LINE_MS => {
                self.reader.forget();
                self.began_ms = None;
                self.out.news(format_args!("error: {}", LineError::Unfinished));
            }
            None if self.reader.begun() => self.began_ms = Some(now_ms),
            _ => {}
        }
        // One line per pass: its computation must not hold up the main loop. Frames come first, because a list can wait.
        if self.flushed(port) && self.send_frames(port, desk, drive) {
            self.next_of_list(desk, drive);
            self.flushed(port);
        }
    }

    fn ok(&mut self) {
        self.out.answer(format_args!("ok"));
    }

    fn error(&mut self, why: &dyn fmt::Display) {
        self.out.answer(format_args!("error: {why}"));
    }

    /// Sends the waiting text; returns whether none waits any more.
    fn flushed(&mut self, port: &mut impl Port) -> bool {
        let text = self.out.as_str();
        let sent = text.is_empty() || port.write(text.as_bytes());
        if sent {
            self.out.clear();
        }
        sent
    }

    fn take(&mut self, byte: u8, desk: &mut Desk, drive: &mut impl Firmware, now_ms: u32) {
        if desk.settings().in_force().command.echo {
            self.reader.echo(byte, &mut self.out);
        }
        // An empty line is a sign of life, too.
        if matches!(byte, b'\r' | b'\n') && !self.reader.begun() {
            self.note_line(desk, now_ms);
        }
        let line = self.reader.push(byte).transpose();
        if !self.reader.begun() {
            self.began_ms = None;
        }
        let Some(line) = line else { return };
        // The next line has its own time.
        (self.list, self.began_ms) = (None, None);
        self.out.begin_answer(None);
        let mut line = match line {
            Ok(line) => line,
            Err(why) => return self.leave_out(&why, desk),
        };
        match grammar::tagged(&line) {
            Ok((tag, _)) => self.out.begin_answer(tag),
            Err(why) => return self.leave_out(&why, desk),
        }
        line.make_ascii_lowercase();
        let request = grammar::tagged(&line).map_or("", |(_, request)| request);
        match grammar::parse(request) {
            Ok(request) => {
                self.note_line(desk, now_ms);
                self.answer(request, desk, drive);
            }
            Err(why) => self.refuse(&why, desk),
        }
    }

    /// Notes a valid line, or an empty one.
    fn note_line(&mut self, desk: &mut Desk, now_ms: u32) {
        desk.note_activity(Commander::Console, now_ms);
        self.line_ms = Some(now_ms);
    }

    /// Refuses a line that may belong to a backup.
    fn leave_out(&mut self, why: &dyn fmt::Display, desk: &mut Desk) {
        desk.leave_out();
        self.error(why);
    }

    /// Answers an invalid line; for an invalid value the answer states the allowed range.
    fn refuse(&mut self, why: &ParseError<'_>, desk: &mut Desk) {
        let range = match why {
            ParseError::Value { key, .. } => {
                key.range(desk.settings().latest()).zip(Some(key.unit()))
            }
            _ => None,
        };
        let Some(((min, max), unit)) = range else { return self.leave_out(why, desk) };
        let space = if unit.is_empty() { "" } else { " " };
        self.leave_out(&format_args!("{why}; allowed is {min} to {max}{space}{unit}"), desk);
    }
}
