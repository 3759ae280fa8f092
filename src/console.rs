//! The console: one line in, one line out, for people and for scripts.
//!
//! Replies begin with `ok` or `error:`, except for requests of data. Some requests answer with many lines and end with
//! `ok`; the next line that comes in cuts them short. An invalid line changes nothing.
//!
//! A request may carry a tag, `@17 speed 300`; the last line of its answer repeats it, `@17 ok`. Lines that come unasked (faults,
//! changes of state, progress) begin with [`line::UNASKED`], which begins no answer and no request.

pub mod announce;
mod answer;
mod bus;
mod commander;
mod commissioning;
mod design;
pub mod grammar;
pub mod handle;
pub mod help;
mod homing;
pub mod line;
mod list;
mod number;
mod reply;
mod restore;
mod status;
mod stream;
mod suggest;
#[cfg(test)]
mod tests;

use core::fmt;

use drive_core::homing::{Failure, Homing};
use drive_core::learned::Learned;

use crate::commissioning::News;
use crate::link::trace::Plan;
use crate::settings::FirmwareSettings;
use crate::settings::bus::Commander;
use crate::settings::staging::Staging;
use announce::Announcer;
use answer::Task;
use bus::Bus;
use grammar::ParseError;
use handle::{DriveHandle, Port};
use line::{LineError, LineReader, OutputLine};
use list::List;
use restore::Restore;
use stream::Wire;

/// Longest time from the first character of a line to its end, ms: a slow typist.
pub const LINE_MS: u32 = 30_000;

const BUS_COMMANDS: &str =
    "the bus commands: `stop` and `clear` work here, `set bus.commands console` takes over";

/// The console.
pub struct Console {
    settings: Staging,
    /// Whether settings in force were changed since they were saved.
    unsaved: bool,
    reader: LineReader,
    /// Text that waits for room in the transmit queue.
    out: OutputLine,
    list: Option<List>,
    task: Option<Task>,
    announcer: Announcer,
    /// Start of the incoming line.
    began_ms: Option<u32>,
    /// Time of the last valid line; `None` to begin anew.
    heard_ms: Option<u32>,
    /// Time of the last valid line at the console, ms.
    line_ms: Option<u32>,
    /// While the wiring is being checked: the periods of the status at its start.
    checking: Option<u32>,
    /// The last trace.
    traced: Option<Plan>,
    /// Whether it waits for its trigger.
    armed: bool,
    /// Result of the last learning, if it is not believable.
    unbelievable: Option<Learned>,
    /// Whether a learning has ended that is not announced yet.
    ended: bool,
    /// News of the commissioning, and the number of the next line about it.
    commissioned: Option<(News, usize)>,
    /// A homing, and how the last one has ended, until that is announced.
    homing: Option<Homing>,
    homed: Option<Result<(), Failure>>,
    restore: Restore,
    /// The stream, and the rate of the port.
    wire: Wire,
    /// The board that the lines that come in belong to, if it is another than this one.
    foreign: Option<&'static str>,
    /// The field bus.
    bus: Bus,
}

/// Most bytes read in one poll: a flood must not hold up the main loop.
const BYTES_AT_ONCE: usize = 64;

impl Console {
    /// A console; the drive has these settings.
    pub fn new(settings: FirmwareSettings) -> Self {
        Self {
            settings: Staging::new(settings),
            unsaved: false,
            reader: LineReader::new(),
            out: OutputLine::default(),
            list: None,
            task: None,
            announcer: Announcer::new(),
            began_ms: None,
            heard_ms: None,
            line_ms: None,
            checking: None,
            traced: None,
            armed: false,
            unbelievable: None,
            ended: false,
            commissioned: None,
            homing: None,
            homed: None,
            restore: Restore::new(),
            wire: Wire::new(),
            foreign: None,
            bus: Bus::default(),
        }
    }

    /// Writes the version and the end of the last run.
    pub fn greet(&mut self, drive: &impl DriveHandle) {
        let (version, last_run) =
            (fmt::from_fn(|f| drive.version(f)), fmt::from_fn(|f| drive.last_run(f)));
        self.out.news(format_args!("induction-drive {version}; last run: {last_run}"));
    }

    /// Reads received bytes and writes replies; never waits. `now_ms` wraps.
    #[inline(never)] // its stack does not add to that of `serve`, which designs as well
    pub fn poll(&mut self, port: &mut impl Port, drive: &mut impl DriveHandle, now_ms: u32) {
        self.watch_wiring(drive);
        drive.learned(&mut |result| {
            self.settings.learned(result);
            self.unsaved |= result.verdict.is_accepted();
            self.unbelievable = Some(*result).filter(|result| !result.verdict.is_accepted());
            self.ended = true;
        });
        if self.commissioned.is_none() {
            self.commissioned = drive.session().news().map(|news| (news, 0));
        }
        if self.homed.is_none() {
            self.homed = self.go_on_homing(drive);
        }
        if port.take_damage() {
            self.reader.spoil(LineError::Lost);
        }
        if self.flushed(port) {
            self.announce(drive, now_ms);
        }
        if self.flushed(port)
            && !self.bus.has_task()
            && let Some(task) = self.task
        {
            self.perform(task, drive, now_ms);
            // A design takes seconds: what has come meanwhile is heard at the next poll, with its time.
            self.flushed(port);
            return;
        }
        for _ in 0..BYTES_AT_ONCE {
            if !self.flushed(port) || self.task.is_some() {
                return;
            }
            let Some(byte) = port.read() else { break };
            self.take(byte, drive, now_ms);
        }
        // What has come is heard first: the main loop may have designed for seconds.
        self.watch_silence(drive, now_ms);
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
        // One line: what it costs to compute must not hold up the main loop. Frames first: a list has time.
        if self.flushed(port) && self.send_frames(port, drive) {
            self.next_of_list(drive);
            self.flushed(port);
        }
    }

    fn ok(&mut self) {
        self.out.answer(format_args!("ok"));
    }

    fn error(&mut self, why: &dyn fmt::Display) {
        if !self.bus.takes_error(why) {
            self.out.answer(format_args!("error: {why}"));
        }
    }

    /// Sends the waiting text; whether none waits any more.
    fn flushed(&mut self, port: &mut impl Port) -> bool {
        let text = self.out.as_str();
        let sent = text.is_empty() || port.write(text.as_bytes());
        if sent {
            self.out.clear();
        }
        sent
    }

    /// Writes the next announcement, if there is one, on a line of its own.
    #[inline(never)]
    fn announce(&mut self, drive: &impl DriveHandle, now_ms: u32) {
        let Some(status) = drive.status() else { return };
        let typed = self.settings.in_force().command.echo && self.reader.begun();
        if typed {
            self.out.raw("\r\n");
        }
        let empty = self.out.as_str().len();
        if core::mem::take(&mut self.ended) {
            let learned = self.settings.in_force().learned.as_ref();
            if let Some(result) = self.unbelievable.as_ref().or(learned) {
                self.out.news(format_args!("{}", announce::outcome(result)));
                if let Some(tracked) = self.settings.in_force().drive.tracked(result) {
                    self.out.news(format_args!("learned: {tracked}"));
                }
            }
        } else if let Some(news) =
            self.announcer.next(&status, &self.settings.in_force().drive, now_ms)
        {
            self.out.news(format_args!("{news}"));
        } else if let Some((news, line)) = self.commissioned {
            let (text, next) = commissioning::told(&news, line);
            self.out.news(format_args!("commissioning: {text}"));
            self.commissioned = next.map(|line| (news, line));
        } else if let Some(homed) = self.homed.take() {
            match homed {
                Ok(()) => self.out.news(format_args!("homing: position 0 is at the stop")),
                Err(why) => self.out.news(format_args!("homing: {why}")),
            }
        } else if self.armed && !drive.tracing() {
            self.armed = false;
            self.out.news(format_args!("trace: recorded; `trace` prints it"));
        } else if let Some(why) = self.bus.news() {
            self.out.news(format_args!("bus: refused: {why}"));
        }
        if self.out.as_str().len() == empty {
            self.out.clear();
        } else if typed {
            self.out.raw(self.reader.text());
        }
    }

    /// Notes when the drive has passed the check of the wiring: it need not be repeated.
    fn watch_wiring(&mut self, drive: &impl DriveHandle) {
        let (Some(began), Some(status)) = (self.checking, drive.status()) else { return };
        // A report from before the start does not count.
        if status.state.has_current() && status.periods != began {
            self.settings.note(|settings| settings.command.wiring_checked = true);
            self.unsaved = true;
            self.checking = None;
        }
    }

    fn take(&mut self, byte: u8, drive: &mut impl DriveHandle, now_ms: u32) {
        if self.settings.in_force().command.echo {
            self.reader.echo(byte, &mut self.out);
        }
        // An empty line is a sign of life, too.
        if matches!(byte, b'\r' | b'\n') && !self.reader.begun() {
            self.heard(Commander::Console, now_ms);
        }
        let Some(line) = self.reader.push(byte).transpose() else { return };
        // The next line has its own time.
        (self.list, self.began_ms) = (None, None);
        self.out.begin_answer(None);
        let mut line = match line {
            Ok(line) => line,
            Err(why) => return self.error(&why),
        };
        let request = match grammar::tagged(&mut line) {
            Ok((tag, request)) => {
                self.out.begin_answer(tag);
                request
            }
            Err(why) => return self.error(&why),
        };
        request.make_ascii_lowercase();
        match grammar::parse(request) {
            Ok(request) => {
                self.heard(Commander::Console, now_ms);
                if self.is_for_the_bus(&request) {
                    return self.error(&BUS_COMMANDS);
                }
                self.answer(request, drive);
            }
            Err(why) => self.refuse(&why),
        }
    }

    /// Answers an invalid line; for a value with the allowed range.
    fn refuse(&mut self, why: &ParseError<'_>) {
        let range = match why {
            ParseError::Value { key, .. } => {
                key.range(self.settings.latest()).zip(Some(key.unit()))
            }
            _ => None,
        };
        let Some(((min, max), unit)) = range else { return self.error(why) };
        let space = if unit.is_empty() { "" } else { " " };
        self.error(&format_args!("{why}; allowed is {min} to {max}{space}{unit}"));
    }
}
