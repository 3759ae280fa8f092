//! The console's other wire: requests of the field bus.
//!
//! A write becomes a [`Request`] that is answered as if it were a line; what it would have been told in words, if it is
//! refused, is announced once. A run command holds until a stop; when the drive stopped for another reason (console,
//! time-out, fault), a master that repeats its run command does not start it again before it has written a stop.

use drive_core::{Command, Mode, State};
use heapless::String;
use modbus_core::Exception;

use super::Console;
use super::grammar::Request;
use super::handle::DriveHandle;
use super::line::OutputLine;
use crate::modbus::faults::FaultLog;
use crate::modbus::float::from_float;
use crate::modbus::registers::{COMMAND, FREQUENCY, RESET, SETTINGS, SETTINGS_END, STAGED, View};
use crate::modbus::slave::{self, Registers};
use crate::modbus::{Frame, Port};
use crate::settings::bus::Commander;
use crate::settings::keys;
use crate::settings::staging::{Assignments, MOST};

/// Fields of the command word: what to do, and the direction. Other bits are refused.
const ACTION: u16 = 0b11;
const STOP: u16 = 1;
const RUN: u16 = 2;
const FORWARD: u16 = 1 << 4;
const REVERSE: u16 = 1 << 5;
/// Bit of the reset register.
const CLEAR: u16 = 1 << 1;

/// The longest refusal that is announced.
const LONGEST_REFUSAL: usize = 120;

/// The run command of the bus.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    /// None, or a stop.
    Stop,
    /// A start was taken; the controllers are being designed.
    Starting,
    /// The drive runs for the bus.
    Run,
    /// The drive has stopped for another reason.
    Ended,
}

/// What the console knows of the bus.
pub(super) struct Bus {
    order: Order,
    reverse: bool,
    /// The frequency that was written last, 0.01 Hz.
    frequency: u16,
    /// The speed that the drive was given last since its start, rpm.
    given: Option<f32>,
    /// Whether the task of the console is the bus's.
    has_task: bool,
    faults: FaultLog,
    seconds: u32,
    second_ms: u32,
    /// The last refusal, and whether it was announced.
    refusal: String<LONGEST_REFUSAL>,
    announced: bool,
}

impl Bus {
    pub(super) const fn new() -> Self {
        Self {
            order: Order::Stop,
            reverse: false,
            frequency: 0,
            given: None,
            has_task: false,
            faults: FaultLog::new(),
            seconds: 0,
            second_ms: 0,
            refusal: String::new(),
            announced: true,
        }
    }

    /// Whether the task of the console is the bus's.
    pub(super) fn has_task(&self) -> bool {
        self.has_task
    }

    /// The refusal that is to be announced, once.
    pub(super) fn news(&mut self) -> Option<&str> {
        (!core::mem::replace(&mut self.announced, true)).then_some(self.refusal.as_str())
    }

    /// Notes a refusal; a master that repeats itself is announced once.
    fn refused(&mut self, why: &str) {
        let why = why.get(..why.floor_char_boundary(LONGEST_REFUSAL)).unwrap_or_default();
        if self.refusal != why {
            self.refusal.clear();
            // It fits.
            let _ = self.refusal.push_str(why);
            self.announced = false;
        }
    }

    fn command(&self) -> u16 {
        let direction = if self.reverse { REVERSE } else { FORWARD };
        if matches!(self.order, Order::Run | Order::Starting) { RUN | direction } else { STOP }
    }
}

impl Console {
    /// Who commands: by the staged settings, which a start puts in force.
    fn commander(&self) -> Commander {
        self.settings.latest().bus.commander
    }

    /// Notes a valid line or frame: silence of the one that commands stops the drive.
    pub(super) fn heard(&mut self, from: Commander, now_ms: u32) {
        if self.commander() == from {
            self.heard_ms = Some(now_ms);
        }
    }

    /// Whether a line is refused because the bus commands. Stop, clear, and all that needs the drive off are not.
    pub(super) fn is_for_the_bus(&self, request: &Request) -> bool {
        self.commander() == Commander::Bus
            && matches!(
                request,
                Request::Start(_)
                    | Request::Learn { .. }
                    | Request::Commission(..)
                    | Request::Relock
                    | Request::Torque(_)
                    | Request::Speed(_)
                    | Request::Position(_)
            )
    }

    /// Answers a frame of the bus, if there is one, and follows its orders; never waits. `now_ms` wraps.
    pub fn serve(&mut self, port: &mut impl Port, drive: &mut impl DriveHandle, now_ms: u32) {
        let settings = self.settings.in_force().bus;
        port.set_line(settings.baud, settings.format);
        while now_ms.wrapping_sub(self.bus.second_ms) >= 1000 {
            self.bus.second_ms = self.bus.second_ms.wrapping_add(1000);
            self.bus.seconds += 1;
        }
        if let Some(status) = drive.status() {
            self.bus.faults.watch(status.state, self.bus.seconds);
        }
        if let (true, Some(task)) = (self.bus.has_task, self.task) {
            self.bus.has_task = false;
            self.quietly(|console| console.perform(task, drive, now_ms));
        }
        // A task of the console comes first.
        if self.task.is_some() {
            return;
        }
        self.follow_order(drive);
        let Some(frame) = port.receive() else { return };
        let mut out = Frame::new();
        let mut access = Access { console: self, drive };
        // The setting is 1 to 247.
        if slave::answer(&frame, settings.address as u8, &mut access, &mut out) {
            self.heard(Commander::Bus, now_ms);
        }
        if !out.is_empty() {
            port.send(&out);
        }
    }

    /// Gives the drive the speed of a run command, and ends the command if the drive has stopped.
    fn follow_order(&mut self, drive: &mut impl DriveHandle) {
        let stopping = drive.status().is_some_and(|status| status.state == State::Stopping);
        match self.bus.order {
            Order::Starting | Order::Run if drive.is_off() || stopping => {
                self.bus.order = Order::Ended;
            }
            Order::Starting | Order::Run => {
                self.bus.order = Order::Run;
                // The answer has been given; a refusal is announced.
                let _ = self.refer(drive);
            }
            Order::Stop | Order::Ended => {}
        }
    }

    /// Gives the speed, if it is another than before.
    fn refer(&mut self, drive: &mut impl DriveHandle) -> Result<(), Exception> {
        let pole_pairs = f32::from(self.settings.in_force().drive.motor.pole_pairs);
        let rpm = f32::from(self.bus.frequency) * (0.01 * 60.0) / pole_pairs;
        let rpm = if self.bus.reverse { -rpm } else { rpm };
        if self.bus.given == Some(rpm) {
            return Ok(());
        }
        self.bus.given = Some(rpm);
        self.ask(Request::Speed(rpm), drive)
    }

    /// Answers a request of the bus as if it were a line.
    fn ask(&mut self, request: Request, drive: &mut impl DriveHandle) -> Result<(), Exception> {
        let free = self.task.is_none();
        let taken = self.quietly(|console| console.answer(request, drive));
        self.bus.has_task |= free && self.task.is_some();
        if taken { Ok(()) } else { Err(Exception::ServerDeviceFailure) }
    }

    /// Does something whose answer is not for the console's wire; whether it was not refused.
    fn quietly(&mut self, work: impl FnOnce(&mut Self)) -> bool {
        let waiting = core::mem::replace(&mut self.out, OutputLine::new());
        work(self);
        let said = core::mem::replace(&mut self.out, waiting);
        let refused = said.as_str().trim_end().strip_prefix("error: ");
        refused.inspect(|why| self.bus.refused(why)).is_none()
    }

    fn run(&mut self, drive: &mut impl DriveHandle) -> Result<(), Exception> {
        match self.bus.order {
            Order::Starting => Ok(()),
            Order::Run => self.refer(drive),
            Order::Ended => {
                self.bus.refused("the drive has stopped for another reason: write a stop first");
                Err(Exception::ServerDeviceFailure)
            }
            Order::Stop => {
                self.ask(Request::Start(Mode::Speed), drive)?;
                (self.bus.order, self.bus.given) = (Order::Starting, None);
                Ok(())
            }
        }
    }
}

/// The registers, with the drive behind them.
struct Access<'a, D> {
    console: &'a mut Console,
    drive: &'a mut D,
}

impl<D: DriveHandle> Access<'_, D> {
    fn command(&mut self, word: u16) -> Result<(), Exception> {
        let bus = &mut self.console.bus;
        if word & !(ACTION | FORWARD | REVERSE) != 0 || word & ACTION == ACTION {
            return Err(Exception::IllegalDataValue);
        }
        let commands = self.console.settings.latest().bus.commander == Commander::Bus;
        // Anybody may stop the drive. A release by a master that does not command changes nothing.
        if word & ACTION == STOP || (word == 0 && commands) {
            bus.order = Order::Stop;
            let stopped = self.drive.command(Command::Stop);
            return stopped.map(|_| ()).or(Err(Exception::ServerDeviceFailure));
        }
        if word == 0 {
            return Ok(());
        }
        self.may_command()?;
        let bus = &mut self.console.bus;
        bus.reverse = match word & (FORWARD | REVERSE) {
            0 => bus.reverse,
            FORWARD => false,
            REVERSE => true,
            _ => !bus.reverse,
        };
        match word & ACTION {
            RUN => self.console.run(self.drive),
            _ if bus.order == Order::Run => self.console.refer(self.drive),
            _ => Ok(()),
        }
    }

    fn frequency(&mut self, word: u16) -> Result<(), Exception> {
        self.may_command()?;
        self.console.bus.frequency = word;
        if self.console.bus.order == Order::Run { self.console.refer(self.drive) } else { Ok(()) }
    }

    fn may_command(&mut self) -> Result<(), Exception> {
        if self.console.commander() == Commander::Bus {
            return Ok(());
        }
        self.console.bus.refused("the console commands: `set bus.commands bus` lets the bus");
        Err(Exception::ServerDeviceFailure)
    }

    /// Stages settings, whole ones.
    fn stage(&mut self, at: u16, words: &[u16]) -> Result<(), Exception> {
        self.may_command()?;
        let first = usize::from(at - SETTINGS);
        if !first.is_multiple_of(2) || !words.len().is_multiple_of(2) || words.len() > 2 * MOST {
            return Err(Exception::IllegalDataValue);
        }
        let mut values = Assignments::new();
        for (n, pair) in words.chunks_exact(2).enumerate() {
            let key = keys::number(first / 2 + n).ok_or(Exception::IllegalDataAddress)?;
            let float = f32::from_bits(u32::from(pair[0]) << 16 | u32::from(pair[1]));
            // There is room.
            let _ = values.push((key, from_float(key, self.console.settings.latest(), float)?));
        }
        if !self.drive.is_off() {
            return self.console.ask(Request::Set(values), self.drive);
        }
        self.console.ask(Request::Set(values), self.drive).or(Err(Exception::IllegalDataValue))
    }

    fn staged(&mut self, word: u16) -> Result<(), Exception> {
        self.may_command()?;
        let request = match word {
            1 => Request::Apply,
            2 => Request::Save,
            3 => Request::Revert,
            _ => return Err(Exception::IllegalDataValue),
        };
        self.console.ask(request, self.drive)
    }
}

impl<D: DriveHandle> Registers for Access<'_, D> {
    fn read(&mut self, at: u16) -> Result<u16, Exception> {
        let Console { settings, bus, .. } = &*self.console;
        let view = View {
            status: self.drive.status(),
            settings: settings.in_force(),
            latest: settings.latest(),
            staged: if at == STAGED { settings.count() } else { 0 },
            command: bus.command(),
            frequency: bus.frequency,
            faults: &bus.faults,
            seconds: bus.seconds,
        };
        view.read(at)
    }

    fn write(&mut self, at: u16, words: &[u16]) -> Result<(), Exception> {
        match (at, words) {
            (COMMAND, [word]) => self.command(*word),
            (FREQUENCY, [word]) => self.frequency(*word),
            // The frequency first: a run command begins with it.
            (COMMAND, [word, frequency]) => {
                if *word & ACTION == RUN {
                    self.frequency(*frequency)?;
                }
                self.command(*word)
            }
            (RESET, [0]) => Ok(()),
            (RESET, [CLEAR]) => {
                self.may_command()?;
                self.console.ask(Request::Clear, self.drive)
            }
            (RESET, [_]) => Err(Exception::IllegalDataValue),
            (SETTINGS..SETTINGS_END, _) => self.stage(at, words),
            (STAGED, [word]) => self.staged(*word),
            _ => Err(Exception::IllegalDataAddress),
        }
    }
}
