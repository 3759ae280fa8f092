//! The console: one line in, one line out, for people and for scripts.
//!
//! Replies begin with `ok` or `error:`, but for those that are asked for data. `help`, `get` and
//! `trace` answer with many lines and end with `ok`; the next line that comes in cuts them short.
//! Whatever is not understood changes nothing.

pub mod grammar;
pub mod keys;
pub mod line;

use core::fmt::{self, Write};

use drive_core::decimal::{Fixed, Shortest};
use drive_core::settings::{PERIOD_S, SettingsError};
use drive_core::{Coefficients, Mode, Refused, State, Taken};

use crate::board::CYCLES_PER_US;
use crate::link::{Order, Status};
use crate::saved::Failed;
use crate::trace::{self, Choice};
use crate::tracking::Report;
use grammar::{HELP, Level, Request};
use keys::{Everything, KEYS, Value};
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
pub trait Machine {
    /// Gives the drive an order and waits for its answer, a few control periods at most.
    ///
    /// # Errors
    /// Why it is not carried out.
    fn order(&mut self, order: Order) -> Result<Taken, NotDone>;
    /// What the drive does now.
    fn status(&self) -> Option<Status>;
    /// Whether the outputs are off and stay off until the next order.
    fn is_off(&self) -> bool;
    /// Makes coefficients of settings. Takes long: only while the outputs are off.
    ///
    /// # Errors
    /// Why the settings are none.
    fn build(&mut self, settings: &Everything) -> Result<Coefficients, SettingsError>;
    /// The drive has taken these settings.
    fn configured(&mut self, settings: &Everything);
    /// What is known of the rotor time constant, where it is tracked.
    fn tracking(&self) -> Option<Report>;
    /// Keeps the settings over a reset, which takes long: only while the outputs are off.
    ///
    /// # Errors
    /// Why not.
    fn save(&mut self, settings: &Everything) -> Result<(), Failed>;
    /// Starts a trace, if none is being recorded; says whether it did.
    fn begin_trace(&mut self, records: u16, divider: u16, choice: &Choice) -> bool;
    /// Whether a trace is being recorded.
    fn tracing(&self) -> bool;
    /// A record of the last trace.
    fn traced(&self, i: u16) -> Option<trace::Record>;
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
}

/// The console.
pub struct Console {
    settings: Everything,
    lines: Lines,
    /// A line that waits for room.
    out: Option<Text>,
    list: Option<List>,
    /// When the line that is coming in began.
    began_ms: Option<u32>,
    /// When a line was last understood.
    heard_ms: u32,
    /// The wiring is being checked; the periods of the status when that began.
    checking: Option<u32>,
    /// What the last trace recorded.
    traced: Choice,
}

/// Most bytes that are read at one go: a flood must not keep the main loop.
const BYTES_AT_ONCE: usize = 64;

impl Console {
    /// A console over settings that the drive has.
    pub const fn new(settings: Everything) -> Self {
        Self {
            settings,
            lines: Lines::new(),
            out: None,
            list: None,
            began_ms: None,
            heard_ms: 0,
            checking: None,
            traced: Choice::NONE,
        }
    }

    /// Says who this is and what ended the last run.
    pub fn greet(&mut self, machine: &impl Machine) {
        self.reply(|text| {
            text.write_str("induction-drive ")?;
            machine.version(text)?;
            text.write_str("; last run: ")?;
            machine.last_run(text)
        });
    }

    /// Reads what came and writes what is due; never waits. `now_ms` wraps.
    pub fn poll(&mut self, port: &mut impl Port, machine: &mut impl Machine, now_ms: u32) {
        self.watch_silence(machine, now_ms);
        self.watch_wiring(machine);
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
                self.reply(|text| write!(text, "error: {}", Garbled::Unfinished));
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
        match &self.out {
            Some(text) if !port.write(text.as_str()) => false,
            _ => {
                self.out = None;
                true
            }
        }
    }

    /// Stops the drive when nobody has spoken for too long.
    fn watch_silence(&mut self, machine: &mut impl Machine, now_ms: u32) {
        let limit = self.settings.command.timeout_s;
        let silence = now_ms.wrapping_sub(self.heard_ms) as f32 * 1e-3;
        if limit > 0.0 && silence > limit && self.out.is_none() && !machine.is_off() {
            let answer = machine.order(Order::Stop);
            self.heard_ms = now_ms;
            match answer {
                Ok(_) => {
                    self.reply(|text| write!(text, "stopped: no command for {} s", Shortest(limit)))
                }
                Err(why) => self.reply(|text| write!(text, "error: not stopped: {why}")),
            }
        }
    }

    /// A drive that has got past the check of the wiring need not check it again.
    fn watch_wiring(&mut self, machine: &impl Machine) {
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
    fn start(&mut self, mode: Mode, machine: &mut impl Machine) {
        if self.settings.command.wiring_checked {
            return self.give(Order::Start(mode), machine);
        }
        let began = machine.status().map(|status| status.periods);
        match machine.order(Order::CheckWiring).and_then(|_| machine.order(Order::Start(mode))) {
            Ok(_) => {
                self.checking = began;
                self.reply(|text| text.write_str("ok: the wiring is checked first"));
            }
            Err(why) => self.reply(|text| write!(text, "error: {why}")),
        }
    }

    fn take(&mut self, byte: u8, machine: &mut impl Machine, now_ms: u32) {
        let request = match self.lines.push(byte) {
            None => return,
            Some(Err(why)) => {
                (self.list, self.began_ms) = (None, None);
                return self.reply(|text| write!(text, "error: {why}"));
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
            Err(why) => self.reply(|text| write!(text, "error: {why}")),
        }
    }

    fn reply(&mut self, write: impl FnOnce(&mut Text) -> fmt::Result) {
        let mut text = Text::new();
        // What does not fit is cut off; the text itself cannot fail.
        let _ = write(&mut text);
        text.end_line();
        self.out = Some(text);
    }

    fn answer(&mut self, request: Request, machine: &mut impl Machine) {
        match request {
            Request::Help => self.list = Some(List::Help(0)),
            Request::Status => match machine.status() {
                Some(status) => {
                    let stack = machine.stack();
                    let tracking = machine.tracking().filter(|_| status.state.regulates());
                    self.reply(|text| {
                        write_status(text, &status, stack)?;
                        tracking.map_or(Ok(()), |report| write!(text, "; {report}"))
                    });
                }
                None => self.reply(|text| write!(text, "error: {}", NotDone::NoAnswer)),
            },
            Request::Start(mode) => self.start(mode, machine),
            Request::Stop => self.give(Order::Stop, machine),
            Request::Relock => self.give(Order::Relock, machine),
            Request::Torque(i_q) => self.give(Order::Torque(i_q), machine),
            Request::Speed(rpm) => self.give(Order::Speed(rpm), machine),
            Request::Position(turns) => self.give(Order::Position(turns), machine),
            Request::Clear => self.give(Order::Clear, machine),
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
            Request::Defaults => self.configure(Everything::of_the_board(), machine),
            Request::Get(Some(key)) => {
                let settings = self.settings;
                self.reply(|text| write_key(text, key, &settings));
            }
            Request::Get(None) => self.list = Some(List::Get(0)),
            Request::Save => {
                if !machine.is_off() {
                    return self.reply(|text| write!(text, "error: {}", MUST_BE_OFF));
                }
                match machine.save(&self.settings) {
                    Ok(()) => self.reply(|text| text.write_str("ok")),
                    Err(why) => self.reply(|text| write!(text, "error: {why}")),
                }
            }
            Request::Faults => {
                let state = machine.status().map(|status| status.state);
                self.reply(|text| {
                    match state {
                        Some(State::Fault(fault)) => {
                            write!(text, "latched: fault {}, {fault}; ", fault.code())?;
                        }
                        _ => text.write_str("none latched; ")?,
                    }
                    text.write_str("last run: ")?;
                    machine.last_run(text)
                });
            }
            Request::Trace { records, divider, choice } => {
                if machine.begin_trace(records, divider, &choice) {
                    self.traced = choice;
                    self.list = Some(List::Trace(0));
                } else {
                    self.reply(|text| text.write_str("error: a trace is being recorded"));
                }
            }
            Request::Log(level) => {
                machine.set_log_level(level);
                self.reply(|text| text.write_str("ok"));
            }
            Request::Version => self.reply(|text| machine.version(text)),
        }
    }

    fn give(&mut self, order: Order, machine: &mut impl Machine) {
        match machine.order(order) {
            Ok(Taken::AsGiven) => self.reply(|text| text.write_str("ok")),
            Ok(Taken::Limited(value)) => {
                self.reply(|text| write!(text, "ok: limited to {}", Shortest(value)))
            }
            Err(why) => self.reply(|text| write!(text, "error: {why}")),
        }
    }

    /// Takes other settings, if the drive is off and the design rules take them.
    fn configure(&mut self, settings: Everything, machine: &mut impl Machine) {
        if !machine.is_off() {
            return self.reply(|text| write!(text, "error: {}", MUST_BE_OFF));
        }
        match machine.build(&settings) {
            Err(why) => self.reply(|text| write!(text, "error: {why}")),
            Ok(coefficients) => match machine.order(Order::Configure(coefficients)) {
                Err(why) => self.reply(|text| write!(text, "error: {why}")),
                Ok(_) => {
                    let waits = settings.drive.inverter.dead_time_s
                        != self.settings.drive.inverter.dead_time_s;
                    self.settings = settings;
                    machine.configured(&settings);
                    self.reply(|text| text.write_str(if waits { FROM_RESET } else { "ok" }));
                }
            },
        }
    }

    /// Puts the next line of the list out; `false` if it has to wait for it.
    fn next_of_list(&mut self, machine: &impl Machine) -> bool {
        let Some(list) = self.list else { return false };
        let (settings, traced) = (self.settings, self.traced);
        match list {
            List::Help(i) => match HELP.get(usize::from(i)) {
                Some(line) => self.one_of_list(List::Help(i + 1), |text| text.write_str(line)),
                None => self.end_list(),
            },
            List::Get(i) => match KEYS.get(usize::from(i)) {
                Some(key) => {
                    self.one_of_list(List::Get(i + 1), |text| write_key(text, key, &settings));
                }
                None => self.end_list(),
            },
            List::Trace(_) if machine.tracing() => return false,
            List::Trace(0) => {
                self.one_of_list(List::Trace(1), |text| {
                    text.write_str("record")?;
                    traced.names().try_for_each(|name| write!(text, ",{name}"))
                });
            }
            List::Trace(i) => match machine.traced(i - 1) {
                Some(record) => self.one_of_list(List::Trace(i + 1), |text| {
                    write!(text, "{}", i - 1)?;
                    let values = record.iter().take(traced.count());
                    values.copied().try_for_each(|x| write!(text, ",{}", Fixed::<4>(x)))
                }),
                None => self.end_list(),
            },
        }
        true
    }

    fn one_of_list(&mut self, next: List, write: impl FnOnce(&mut Text) -> fmt::Result) {
        self.reply(write);
        self.list = Some(next);
    }

    fn end_list(&mut self) {
        self.list = None;
        self.reply(|text| text.write_str("ok"));
    }
}

/// The timer locks its dead time until a reset.
const FROM_RESET: &str = "ok: the dead time holds from the next reset on, if saved";
const MUST_BE_OFF: &str = "the drive must be off: `stop` first";

/// Speed in rpm from turns per period.
fn rpm(step: f32) -> f32 {
    step * (60.0 / PERIOD_S)
}

fn write_status(text: &mut Text, s: &Status, (used, size): (usize, usize)) -> fmt::Result {
    let t = &s.telemetry;
    write!(
        text,
        "{}; i_d {} A, i_q {} of {} A, rotor {} rpm electrical, dc link {} V; ",
        s.state,
        Fixed::<2>(t.current.d),
        Fixed::<2>(t.current.q),
        Fixed::<2>(t.reference.q),
        Fixed::<1>(rpm(t.rotor_step)),
        Fixed::<0>(t.dc_link),
    )?;
    write!(
        text,
        "{} of {} cycles, latest start {} us, stack {used} of {size}",
        s.last_cycles,
        s.worst_cycles,
        Fixed::<1>(s.worst_latency as f32 / CYCLES_PER_US as f32),
    )
}

fn write_key(text: &mut Text, key: &keys::Key, settings: &Everything) -> fmt::Result {
    let value = key.get(settings);
    write!(text, "{} = {value}", key.name)?;
    if !key.unit.is_empty() {
        write!(text, " {}", key.unit)?;
    }
    match value {
        Value::Word { .. } => {
            text.write_str(" (one of:")?;
            key.words().iter().try_for_each(|word| write!(text, " {word}"))?;
            text.write_str(")")
        }
        _ => match key.range(settings) {
            Some((min, max)) => write!(text, " ({} to {})", Shortest(min), Shortest(max)),
            None => Ok(()),
        },
    }
}

#[cfg(test)]
mod tests;
