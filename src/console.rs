//! The console: one line in, one line out, for people and for scripts.
//!
//! Replies begin with `ok` or `error:`, but for those that are asked for data. `help`, `get` and
//! `trace` answer with many lines and end with `ok`; the next line that comes in cuts them short.
//! Whatever is not understood changes nothing.

#[cfg(not(target_os = "none"))]
#[doc(hidden)]
pub mod doubles;
pub mod grammar;
pub mod keys;
mod learned;
pub mod line;

use core::fmt::{self, Write};

use drive_core::identify::learning::Learned;
use drive_core::io::PERIOD_S;
use drive_core::math::decimal::{Fixed, Shortest};
use drive_core::settings::{Scales, SettingsError};
use drive_core::{Accepted, Coefficients, Command, Mode, Refused, State};

use crate::board::CYCLES_PER_US;
use crate::link::Status;
use crate::link::trace::{self, Choice};
use crate::rotor_tracking::Report;
use crate::store::Failed;
use grammar::{HELP, Level, Request};
use keys::{FirmwareSettings, KEYS, Value};
use line::{Garbled, Lines, Text};

/// How long a line may take from its first character to its end, ms: a slow hand.
pub const LINE_MS: u32 = 30_000;

/// Why an order was not carried out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotDone {
    /// The drive refuses.
    Refused(Refused),
    /// The control interrupt does not run.
    NoAnswer,
}

impl fmt::Display for NotDone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(why) => why.fmt(f),
            Self::NoAnswer => f.write_str("the control does not run"),
        }
    }
}

/// What the console talks about.
pub trait DriveHandle {
    /// Gives the drive an order and waits for its answer, a few control periods at most.
    ///
    /// # Errors
    /// Why it is not carried out.
    fn order(&mut self, order: Command) -> Result<Accepted, NotDone>;
    /// What the drive does now.
    fn status(&self) -> Option<Status>;
    /// Whether the outputs are off and stay off until the next order.
    fn is_off(&self) -> bool;
    /// Makes coefficients of settings. Takes long: only while the outputs are off.
    ///
    /// # Errors
    /// Why the settings are none.
    fn build(&mut self, settings: &FirmwareSettings) -> Result<Coefficients, SettingsError>;
    /// The drive has taken these settings.
    fn configured(&mut self, settings: &FirmwareSettings);
    /// What is known of the rotor time constant, where it is tracked.
    fn tracking(&self) -> Option<Report>;
    /// Keeps the settings over a reset, which takes long: only while the outputs are off.
    ///
    /// # Errors
    /// Why not.
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), Failed>;
    /// Starts a trace, if none is being recorded; says whether it did.
    fn begin_trace(&mut self, records: u16, divider: u16, choice: &Choice) -> bool;
    /// Whether a trace is being recorded.
    fn tracing(&self) -> bool;
    /// A record of the last trace.
    fn traced(&self, i: u16) -> Option<trace::Record>;
    /// Shows what a learning has found since the last call, used or not.
    fn learned(&mut self, show: &mut dyn FnMut(&Learned));
    /// Sets how much is logged.
    fn set_log_level(&mut self, level: Level);
    /// Most bytes of the stack used so far, and its size.
    fn stack(&self) -> (usize, usize);
    /// Which firmware this is.
    fn version(&self, to: &mut dyn Write) -> fmt::Result;
    /// What ended the last run.
    fn last_run(&self, to: &mut dyn Write) -> fmt::Result;
}

/// The console's end of the serial port.
pub trait Port {
    /// The next byte that came in.
    fn read(&mut self) -> Option<u8>;
    /// Whether bytes were lost or damaged since the last call.
    fn take_damage(&mut self) -> bool;
    /// Sends the whole text, or nothing if it does not fit now; says whether it did.
    fn write(&mut self, text: &str) -> bool;
}

/// A reply of many lines, and which comes next.
#[derive(Clone, Copy, Debug, PartialEq)]
enum List {
    Help(u16),
    Get(u16),
    Trace(u16),
    Learned(u16),
}

impl List {
    fn next(self) -> Self {
        match self {
            Self::Help(i) => Self::Help(i + 1),
            Self::Get(i) => Self::Get(i + 1),
            Self::Trace(i) => Self::Trace(i + 1),
            Self::Learned(i) => Self::Learned(i + 1),
        }
    }
}

/// A line that waits for room on the wire.
struct Out(Option<Text>);

impl Out {
    /// Takes a line; what does not fit is cut off. (The only place that writes text: to write it into
    /// every answer would take 2 KiB.)
    #[inline(never)]
    fn line(&mut self, line: fmt::Arguments<'_>) {
        let text = self.0.insert(Text::new());
        // The text itself cannot fail.
        let _ = text.write_fmt(line);
        text.end_line();
    }

    fn ok(&mut self) {
        self.line(format_args!("ok"));
    }

    #[inline(never)]
    fn error(&mut self, why: &dyn fmt::Display) {
        self.line(format_args!("error: {why}"));
    }
}

/// The console.
pub struct Console {
    settings: FirmwareSettings,
    lines: Lines,
    out: Out,
    list: Option<List>,
    /// When the line that is coming in began.
    began_ms: Option<u32>,
    /// When a line was last understood.
    heard_ms: u32,
    /// The wiring is being checked; the periods of the status when that began.
    checking: Option<u32>,
    /// What the last trace recorded.
    traced: Choice,
    /// What the last learning found, if it is not believable.
    unbelievable: Option<Learned>,
}

/// Most bytes that are read at one go: a flood must not keep the main loop.
const BYTES_AT_ONCE: usize = 64;

impl Console {
    /// A console over settings that the drive has.
    pub const fn new(settings: FirmwareSettings) -> Self {
        Self {
            settings,
            lines: Lines::new(),
            out: Out(None),
            list: None,
            began_ms: None,
            heard_ms: 0,
            checking: None,
            traced: Choice::NONE,
            unbelievable: None,
        }
    }

    /// Says who this is and what ended the last run.
    pub fn greet(&mut self, machine: &impl DriveHandle) {
        let (version, last_run) =
            (fmt::from_fn(|f| machine.version(f)), fmt::from_fn(|f| machine.last_run(f)));
        self.out.line(format_args!("induction-drive {version}; last run: {last_run}"));
    }

    /// Reads what came and writes what is due; never waits. `now_ms` wraps.
    pub fn poll(&mut self, port: &mut impl Port, machine: &mut impl DriveHandle, now_ms: u32) {
        self.watch_silence(machine, now_ms);
        self.watch_wiring(machine);
        machine.learned(&mut |found| {
            self.settings.learn(found);
            self.unbelievable = if found.accepted { None } else { Some(*found) };
        });
        if port.take_damage() {
            self.lines.spoil(Garbled::Lost);
        }
        for _ in 0..BYTES_AT_ONCE {
            if !self.flushed(port) {
                return;
            }
            let Some(byte) = port.read() else { break };
            self.take(byte, machine, now_ms);
        }
        match self.began_ms {
            Some(_) if !self.lines.begun() => self.began_ms = None,
            Some(began) if now_ms.wrapping_sub(began) > LINE_MS => {
                self.lines.forget();
                self.began_ms = None;
                self.out.error(&Garbled::Unfinished);
            }
            None if self.lines.begun() => self.began_ms = Some(now_ms),
            _ => {}
        }
        while self.flushed(port) && self.list.is_some() {
            if !self.next_of_list(machine) {
                break;
            }
        }
    }

    /// Sends what waits; whether nothing waits any more.
    fn flushed(&mut self, port: &mut impl Port) -> bool {
        match &self.out.0 {
            Some(text) if !port.write(text.as_str()) => false,
            _ => {
                self.out.0 = None;
                true
            }
        }
    }

    /// Stops the drive when nobody has spoken for too long.
    fn watch_silence(&mut self, machine: &mut impl DriveHandle, now_ms: u32) {
        let limit = self.settings.command.timeout_s;
        let silence = now_ms.wrapping_sub(self.heard_ms) as f32 * 1e-3;
        if limit > 0.0 && silence > limit && self.out.0.is_none() && !machine.is_off() {
            let answer = machine.order(Command::Stop);
            self.heard_ms = now_ms;
            match answer {
                Ok(_) => {
                    self.out.line(format_args!("stopped: no command for {} s", Shortest(limit)));
                }
                Err(why) => self.out.error(&format_args!("not stopped: {why}")),
            }
        }
    }

    /// A drive that has got past the check of the wiring need not check it again.
    fn watch_wiring(&mut self, machine: &impl DriveHandle) {
        let (Some(began), Some(status)) = (self.checking, machine.status()) else { return };
        let past = matches!(
            status.state,
            State::Magnetising | State::Torque | State::Speed | State::Position
        );
        // Not what it did before.
        if past && status.periods != began {
            self.settings.command.wiring_checked = true;
            self.checking = None;
        }
    }

    /// Starts; the first time since the defaults were set with a check of the wiring.
    fn start(&mut self, mode: Mode, machine: &mut impl DriveHandle) {
        if self.settings.command.wiring_checked {
            return self.give(Command::Start(mode), machine);
        }
        let began = machine.status().map(|status| status.periods);
        match machine.order(Command::CheckWiring).and_then(|_| machine.order(Command::Start(mode)))
        {
            Ok(_) => {
                self.checking = began;
                self.out.line(format_args!("ok: the wiring is checked first"));
            }
            Err(why) => self.out.error(&why),
        }
    }

    fn take(&mut self, byte: u8, machine: &mut impl DriveHandle, now_ms: u32) {
        let request = match self.lines.push(byte) {
            None => return,
            Some(Err(why)) => {
                (self.list, self.began_ms) = (None, None);
                return self.out.error(&why);
            }
            Some(Ok(line)) => grammar::parse(line),
        };
        // The next line has its own time.
        (self.list, self.began_ms) = (None, None);
        match request {
            Ok(request) => {
                self.heard_ms = now_ms;
                self.answer(request, machine);
            }
            Err(why) => self.out.error(&why),
        }
    }

    fn answer(&mut self, request: Request, machine: &mut impl DriveHandle) {
        match request {
            Request::Help => self.list = Some(List::Help(0)),
            Request::Status => match machine.status() {
                Some(status) => {
                    let (scales, stack) = (&self.settings.drive.scales, machine.stack());
                    let tracking = machine.tracking().filter(|_| status.state.regulates());
                    let line = fmt::from_fn(|f| {
                        write_status(f, &status, scales, stack)?;
                        tracking.map_or(Ok(()), |report| write!(f, "; {report}"))
                    });
                    self.out.line(format_args!("{line}"));
                }
                None => self.out.error(&NotDone::NoAnswer),
            },
            Request::Start(mode) => self.start(mode, machine),
            Request::Stop => self.give(Command::Stop, machine),
            Request::Relock => self.give(Command::Relock, machine),
            Request::Torque(i_q) => self.give(Command::Torque(i_q), machine),
            Request::Speed(rpm) => self.give(Command::Speed(rpm), machine),
            Request::Position(turns) => self.give(Command::Position(turns), machine),
            Request::Clear => self.give(Command::Clear, machine),
            Request::Angle(source) => {
                let mut settings = self.settings;
                settings.drive.angle_source = source;
                self.configure(settings, machine);
            }
            Request::Set(key, value) => {
                let mut settings = self.settings;
                key.set(&mut settings, value);
                self.configure(settings, machine);
            }
            Request::Defaults => self.configure(FirmwareSettings::of_the_board(), machine),
            Request::Get(Some(key)) => {
                self.out.line(format_args!("{}", Shown::new(key, &self.settings)));
            }
            Request::Get(None) => self.list = Some(List::Get(0)),
            Request::Learned => {
                if self.unbelievable.is_some() || self.settings.learned.is_some() {
                    self.list = Some(List::Learned(0));
                } else {
                    self.out.line(format_args!("ok: nothing learned with these settings"));
                }
            }
            Request::Save => {
                if !machine.is_off() {
                    return self.out.error(&MUST_BE_OFF);
                }
                match machine.save(&self.settings) {
                    Ok(()) => self.out.ok(),
                    Err(why) => self.out.error(&why),
                }
            }
            Request::Faults => {
                let last_run = fmt::from_fn(|f| machine.last_run(f));
                match machine.status().map(|status| status.state) {
                    Some(State::Fault(fault)) => self.out.line(format_args!(
                        "latched: fault {}, {fault}; last run: {last_run}",
                        fault.code()
                    )),
                    _ => self.out.line(format_args!("none latched; last run: {last_run}")),
                }
            }
            Request::Trace { records, divider, choice } => {
                if machine.begin_trace(records, divider, &choice) {
                    self.traced = choice;
                    self.list = Some(List::Trace(0));
                } else {
                    self.out.error(&"a trace is being recorded");
                }
            }
            Request::Log(level) => {
                machine.set_log_level(level);
                self.out.ok();
            }
            Request::Version => {
                let version = fmt::from_fn(|f| machine.version(f));
                self.out.line(format_args!("{version}"));
            }
        }
    }

    fn give(&mut self, order: Command, machine: &mut impl DriveHandle) {
        match machine.order(order) {
            Ok(Accepted::AsGiven) => self.out.ok(),
            Ok(Accepted::Limited(value)) => {
                self.out.line(format_args!("ok: limited to {}", Shortest(value)));
            }
            Err(why) => self.out.error(&why),
        }
    }

    /// Takes other settings, if the drive is off and the design rules take them. What was learned with
    /// others is forgotten.
    fn configure(&mut self, mut settings: FirmwareSettings, machine: &mut impl DriveHandle) {
        if !machine.is_off() {
            return self.out.error(&MUST_BE_OFF);
        }
        settings.forget_unless_as(&self.settings);
        match machine.build(&settings) {
            Err(why) => self.out.error(&why),
            Ok(coefficients) => match machine.order(Command::Configure(coefficients)) {
                Err(why) => self.out.error(&why),
                Ok(_) => {
                    let waits = settings.drive.inverter.dead_time_s
                        != self.settings.drive.inverter.dead_time_s;
                    let forgotten = self.settings.learned.is_some() && settings.learned.is_none();
                    self.settings = settings;
                    machine.configured(&settings);
                    self.out.line(format_args!(
                        "ok{}{}",
                        if waits { FROM_RESET } else { "" },
                        if forgotten { FORGOTTEN } else { "" },
                    ));
                }
            },
        }
    }

    /// Puts the next line of the list out; `false` if it has to wait for it.
    fn next_of_list(&mut self, machine: &impl DriveHandle) -> bool {
        let Some(list) = self.list else { return false };
        let written = match list {
            List::Help(i) => {
                HELP.get(usize::from(i)).map(|line| self.out.line(format_args!("{line}")))
            }
            List::Get(i) => KEYS.get(usize::from(i)).map(|key| {
                self.out.line(format_args!("{}", Shown::new(key, &self.settings)));
            }),
            List::Trace(_) if machine.tracing() => return false,
            List::Trace(0) => {
                let names =
                    fmt::from_fn(|f| self.traced.names().try_for_each(|name| write!(f, ",{name}")));
                self.out.line(format_args!("record{names}"));
                Some(())
            }
            List::Learned(i) => {
                // If the last was not believable, it is not what is used.
                let found = self.unbelievable.as_ref().or(self.settings.learned.as_ref());
                let line = found.and_then(|f| learned::line(f, self.unbelievable.is_some(), i));
                line.map(|line| self.out.line(format_args!("{line}")))
            }
            List::Trace(i) => machine.traced(i - 1).map(|record| {
                let values = fmt::from_fn(|f| {
                    let mut values = record.iter().take(self.traced.count());
                    values.try_for_each(|x| write!(f, ",{}", Fixed::<4>(*x)))
                });
                self.out.line(format_args!("{}{values}", i - 1));
            }),
        };
        self.list = written.map(|()| list.next());
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

/// Speed in rpm from turns per period.
fn rpm(step: f32) -> f32 {
    step * (60.0 / PERIOD_S)
}

fn write_status(
    f: &mut fmt::Formatter<'_>,
    s: &Status,
    scales: &Scales,
    (used, size): (usize, usize),
) -> fmt::Result {
    let t = &s.telemetry;
    // Dc link and heat sink as they are now: what the drive makes of them stands still while it is off.
    write!(
        f,
        "{}; i_d {} A, i_q {} of {} A, rotor {} rpm electrical, dc link {} V, heat sink code {} of {}; ",
        s.state,
        Fixed::<2>(t.current.d),
        Fixed::<2>(t.current.q),
        Fixed::<2>(t.reference.q),
        Fixed::<1>(rpm(t.rotor_freq)),
        Fixed::<0>(scales.dc_link.at(s.sample.dc_link)),
        s.sample.heat_sink,
        scales.heat_sink_trip,
    )?;
    write!(
        f,
        "{} of {} cycles, latest start {} us, stack {used} of {size}",
        s.last_cycles,
        s.worst_cycles,
        Fixed::<1>(s.worst_latency as f32 / CYCLES_PER_US as f32),
    )
}

/// A setting as it is shown. What has to be computed is before anything is printed: while printing, the
/// stack is deep.
struct Shown {
    key: &'static keys::Key,
    value: Value,
    range: Option<(f32, f32)>,
}

impl Shown {
    #[inline(never)]
    fn new(key: &'static keys::Key, settings: &FirmwareSettings) -> Self {
        Self { key, value: key.get(settings), range: key.range(settings) }
    }
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.key.name, self.value)?;
        if !self.key.unit.is_empty() {
            write!(f, " {}", self.key.unit)?;
        }
        match (self.value, self.range) {
            (Value::Word { .. }, _) => {
                f.write_str(" (one of:")?;
                self.key.words().iter().try_for_each(|word| write!(f, " {word}"))?;
                f.write_str(")")
            }
            (_, Some((min, max))) => write!(f, " ({} to {})", Shortest(min), Shortest(max)),
            (_, None) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
