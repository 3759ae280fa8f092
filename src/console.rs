//! The console: one line in, one line out, for people and for scripts.
//!
//! Replies begin with `ok` or `error:`, except for requests of data. `help`, `get`, `learned` and
//! `trace` answer with many lines and end with `ok`; the next line that comes in cuts them short.
//! An invalid line changes nothing.

pub mod grammar;
pub mod handle;
pub mod line;
mod reply;

use core::fmt;

use drive_core::identify::learning::Learned;
use drive_core::{Accepted, Command, Mode, State};

use crate::link::trace::SignalChoice;
use crate::settings::FirmwareSettings;
use crate::settings::keys;
use grammar::{HELP, Request};
use handle::{CommandError, DriveHandle, Port};
use line::{LineError, LineReader, OutputLine};

/// Longest time from the first character of a line to its end, ms: a slow typist.
pub const LINE_MS: u32 = 30_000;

/// A reply of many lines, with the number of the next line.
#[derive(Clone, Copy)]
struct List {
    kind: ListKind,
    next: u16,
}

#[derive(Clone, Copy, PartialEq)]
enum ListKind {
    Help,
    Settings,
    Trace,
    Learned,
}

/// A line that waits for room in the transmit queue.
struct Pending(Option<OutputLine>);

impl Pending {
    fn line(&mut self, text: fmt::Arguments<'_>) {
        self.0 = Some(OutputLine::new(text));
    }

    fn ok(&mut self) {
        self.line(format_args!("ok"));
    }

    fn error(&mut self, why: &dyn fmt::Display) {
        self.line(format_args!("error: {why}"));
    }
}

/// The console.
pub struct Console {
    settings: FirmwareSettings,
    reader: LineReader,
    out: Pending,
    list: Option<List>,
    /// Start of the incoming line.
    began_ms: Option<u32>,
    /// Time of the last valid line.
    heard_ms: u32,
    /// While the wiring is being checked: the periods of the status at its start.
    checking: Option<u32>,
    /// Signals of the last trace.
    traced: SignalChoice,
    /// Result of the last learning, if it is not believable.
    unbelievable: Option<Learned>,
}

/// Most bytes read in one poll: a flood must not hold up the main loop.
const BYTES_AT_ONCE: usize = 64;

impl Console {
    /// A console; the drive has these settings.
    pub const fn new(settings: FirmwareSettings) -> Self {
        Self {
            settings,
            reader: LineReader::new(),
            out: Pending(None),
            list: None,
            began_ms: None,
            heard_ms: 0,
            checking: None,
            traced: SignalChoice::none(),
            unbelievable: None,
        }
    }

    /// Writes the version and the end of the last run.
    pub fn greet(&mut self, drive: &impl DriveHandle) {
        let (version, last_run) =
            (fmt::from_fn(|f| drive.version(f)), fmt::from_fn(|f| drive.last_run(f)));
        self.out.line(format_args!("induction-drive {version}; last run: {last_run}"));
    }

    /// Reads received bytes and writes replies; never waits. `now_ms` wraps.
    pub fn poll(&mut self, port: &mut impl Port, drive: &mut impl DriveHandle, now_ms: u32) {
        self.watch_silence(drive, now_ms);
        self.watch_wiring(drive);
        drive.learned(&mut |result| {
            self.settings.learn(result);
            self.unbelievable = Some(*result).filter(|result| !result.accepted);
        });
        if port.take_damage() {
            self.reader.spoil(LineError::Lost);
        }
        for _ in 0..BYTES_AT_ONCE {
            if !self.flushed(port) {
                return;
            }
            let Some(byte) = port.read() else { break };
            self.take(byte, drive, now_ms);
        }
        match self.began_ms {
            Some(_) if !self.reader.begun() => self.began_ms = None,
            Some(began) if now_ms.wrapping_sub(began) > LINE_MS => {
                self.reader.forget();
                self.began_ms = None;
                self.out.error(&LineError::Unfinished);
            }
            None if self.reader.begun() => self.began_ms = Some(now_ms),
            _ => {}
        }
        while self.flushed(port) && self.list.is_some() {
            if !self.next_of_list(drive) {
                break;
            }
        }
    }

    /// Sends the waiting line; whether none waits any more.
    fn flushed(&mut self, port: &mut impl Port) -> bool {
        match &self.out.0 {
            Some(text) if !port.write(text.as_str()) => false,
            _ => {
                self.out.0 = None;
                true
            }
        }
    }

    /// Stops the drive when no valid line came for too long.
    fn watch_silence(&mut self, drive: &mut impl DriveHandle, now_ms: u32) {
        let limit = self.settings.command.timeout_s;
        let silence = now_ms.wrapping_sub(self.heard_ms) as f32 * 1e-3;
        if limit > 0.0 && silence > limit && self.out.0.is_none() && !drive.is_off() {
            self.heard_ms = now_ms;
            match drive.command(Command::Stop) {
                Ok(_) => self.out.line(format_args!("stopped: no command for {limit} s")),
                Err(why) => self.out.error(&format_args!("not stopped: {why}")),
            }
        }
    }

    /// Notes when the drive has passed the check of the wiring: it need not be repeated.
    fn watch_wiring(&mut self, drive: &impl DriveHandle) {
        let (Some(began), Some(status)) = (self.checking, drive.status()) else { return };
        let past = matches!(
            status.state,
            State::Magnetising | State::Torque | State::Speed | State::Position
        );
        // A report from before the start does not count.
        if past && status.periods != began {
            self.settings.command.wiring_checked = true;
            self.checking = None;
        }
    }

    /// Starts the drive; the first time since the defaults were set with a check of the wiring.
    fn start(&mut self, mode: Mode, drive: &mut impl DriveHandle) {
        if self.settings.command.wiring_checked {
            return self.give(Command::Start(mode), drive);
        }
        let began = drive.status().map(|status| status.periods);
        match drive.command(Command::CheckWiring).and_then(|_| drive.command(Command::Start(mode)))
        {
            Ok(_) => {
                self.checking = began;
                self.out.line(format_args!("ok: the wiring is checked first"));
            }
            Err(why) => self.out.error(&why),
        }
    }

    fn take(&mut self, byte: u8, drive: &mut impl DriveHandle, now_ms: u32) {
        let line = match self.reader.push(byte) {
            Ok(None) => return,
            Ok(Some(line)) => Ok(line),
            Err(why) => Err(why),
        };
        // The next line has its own time.
        (self.list, self.began_ms) = (None, None);
        match line.map(|line| grammar::parse(&line)) {
            Ok(Ok(request)) => {
                self.heard_ms = now_ms;
                self.answer(request, drive);
            }
            Ok(Err(why)) => self.out.error(&why),
            Err(why) => self.out.error(&why),
        }
    }

    fn answer(&mut self, request: Request, drive: &mut impl DriveHandle) {
        match request {
            Request::Help => self.begin(ListKind::Help),
            Request::Status => match drive.status() {
                Some(status) => {
                    let (scales, stack) = (&self.settings.drive.scales, drive.stack());
                    let tracking = drive.tracking().filter(|_| status.state.regulates());
                    let line = fmt::from_fn(|f| {
                        reply::status(f, &status, scales, stack)?;
                        tracking.map_or(Ok(()), |report| write!(f, "; {report}"))
                    });
                    self.out.line(format_args!("{line}"));
                }
                None => self.out.error(&CommandError::NoAnswer),
            },
            Request::Start(mode) => self.start(mode, drive),
            Request::Stop => self.give(Command::Stop, drive),
            Request::Relock => self.give(Command::Relock, drive),
            Request::Torque(i_q) => self.give(Command::Torque(i_q), drive),
            Request::Speed(rpm) => self.give(Command::Speed(rpm), drive),
            Request::Position(turns) => self.give(Command::Position(turns), drive),
            Request::Clear => self.give(Command::Clear, drive),
            Request::Set(key, value) => {
                let mut settings = self.settings;
                key.set(&mut settings, value);
                self.configure(settings, drive);
            }
            Request::Defaults => self.configure(FirmwareSettings::of_the_board(), drive),
            Request::Get(Some(key)) => {
                let setting = reply::Setting::new(key, &self.settings);
                self.out.line(format_args!("{setting}"));
            }
            Request::Get(None) => self.begin(ListKind::Settings),
            Request::Learned => {
                if self.unbelievable.is_some() || self.settings.learned.is_some() {
                    self.begin(ListKind::Learned);
                } else {
                    self.out.line(format_args!("ok: nothing learned with these settings"));
                }
            }
            Request::Save => {
                if !drive.is_off() {
                    return self.out.error(&MUST_BE_OFF);
                }
                match drive.save(&self.settings) {
                    Ok(()) => self.out.ok(),
                    Err(why) => self.out.error(&why),
                }
            }
            Request::Faults => {
                let last_run = fmt::from_fn(|f| drive.last_run(f));
                match drive.status().map(|status| status.state) {
                    Some(State::Fault(fault)) => self.out.line(format_args!(
                        "latched: fault {}, {fault}; last run: {last_run}",
                        fault.code()
                    )),
                    _ => self.out.line(format_args!("none latched; last run: {last_run}")),
                }
            }
            Request::Trace { records, divider, choice } => {
                if drive.begin_trace(records, divider, &choice) {
                    self.traced = choice;
                    self.begin(ListKind::Trace);
                } else {
                    self.out.error(&"a trace is being recorded");
                }
            }
            Request::Log(level) => {
                drive.set_log_level(level);
                self.out.ok();
            }
            Request::Version => {
                let version = fmt::from_fn(|f| drive.version(f));
                self.out.line(format_args!("{version}"));
            }
        }
    }

    fn begin(&mut self, kind: ListKind) {
        self.list = Some(List { kind, next: 0 });
    }

    fn give(&mut self, command: Command, drive: &mut impl DriveHandle) {
        match drive.command(command) {
            Ok(Accepted::AsGiven) => self.out.ok(),
            Ok(Accepted::Limited(value)) => self.out.line(format_args!("ok: limited to {value}")),
            Err(why) => self.out.error(&why),
        }
    }

    /// Applies other settings, if the drive is off and the design rules allow them. A result learned with other
    /// settings is dropped.
    fn configure(&mut self, mut settings: FirmwareSettings, drive: &mut impl DriveHandle) {
        if !drive.is_off() {
            return self.out.error(&MUST_BE_OFF);
        }
        settings.forget_unless_as(&self.settings);
        match drive.build(&settings) {
            Err(why) => self.out.error(&why),
            Ok(coefficients) => match drive.command(Command::Configure(coefficients)) {
                Err(why) => self.out.error(&why),
                Ok(_) => {
                    let waits = settings.drive.inverter.dead_time_s
                        != self.settings.drive.inverter.dead_time_s;
                    let forgotten = self.settings.learned.is_some() && settings.learned.is_none();
                    self.settings = settings;
                    drive.configured(&settings);
                    self.out.line(format_args!(
                        "ok{}{}",
                        if waits { FROM_RESET } else { "" },
                        if forgotten { FORGOTTEN } else { "" },
                    ));
                }
            },
        }
    }

    /// Writes the next line of the list, or `ok` behind the last; `false` if the list has to wait for it.
    fn next_of_list(&mut self, drive: &impl DriveHandle) -> bool {
        let Some(List { kind, next }) = self.list else { return false };
        let index = usize::from(next);
        let out = &mut self.out;
        let written = match kind {
            ListKind::Help => HELP.get(index).map(|line| out.line(format_args!("{line}"))),
            ListKind::Settings => keys::number(index).map(|key| {
                let setting = reply::Setting::new(key, &self.settings);
                out.line(format_args!("{setting}"));
            }),
            ListKind::Trace if drive.tracing() => return false,
            ListKind::Trace if next == 0 => {
                let names =
                    fmt::from_fn(|f| self.traced.names().try_for_each(|name| write!(f, ",{name}")));
                out.line(format_args!("record{names}"));
                Some(())
            }
            ListKind::Trace => drive.traced(next - 1).map(|record| {
                let values = record.iter().take(self.traced.count());
                let values =
                    fmt::from_fn(|f| values.clone().try_for_each(|x| write!(f, ",{x:.4}")));
                out.line(format_args!("{}{values}", next - 1));
            }),
            ListKind::Learned => {
                // The last result if it is not believable, else the one in use.
                let result = self.unbelievable.as_ref().or(self.settings.learned.as_ref());
                let believable = self.unbelievable.is_none();
                let line = result.and_then(|result| reply::learned(result, believable, next));
                line.map(|line| out.line(format_args!("{line}")))
            }
        };
        self.list = written.map(|()| List { kind, next: next + 1 });
        if written.is_none() {
            self.out.ok();
        }
        true
    }
}

/// The timer locks its dead time until a reset.
const FROM_RESET: &str = ": the dead time holds from the next reset on, if saved";
const FORGOTTEN: &str = ": what was learned belonged to other settings and is forgotten";
const MUST_BE_OFF: &str = "the drive must be off: `stop` first";

#[cfg(test)]
mod tests;
