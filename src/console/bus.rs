//! The console's other wire: requests of the field bus.
//!
//! A write goes the way of a line: the same commands, staging, checks and words, which are announced once if it is
//! refused. A run command holds until a stop; when the drive stopped for another reason (console,
//! time-out, fault), a master that repeats its run command does not start it again before it has written a stop.

use core::fmt::{self, Write as _};

use drive_core::{Command, Mode, Stop};
use modbus_core::Exception;

use super::Console;
use super::answer::{MUST_BE_OFF, Task};
use super::handle::DriveHandle;
use super::line::OutputLine;
use crate::modbus::Port;
use crate::modbus::cia402;
use crate::modbus::faults::FaultLog;
use crate::modbus::float::from_float;
use crate::modbus::registers::{
    COMMAND, CONTROL, FREQUENCY, RESET, RUN, SETTINGS, SETTINGS_END, STAGED, View,
};
use crate::modbus::slave::{self, Registers, Words};
use crate::settings::bus::Commander;
use crate::settings::keys;
use crate::settings::staging::{Assignments, MOST};

/// Fields of the command word: what to do, and the direction. Other bits are refused.
const ACTION: u16 = 0b11;
const STOP: u16 = 1;
const FORWARD: u16 = 1 << 4;
const REVERSE: u16 = 1 << 5;
/// Bit of the reset register.
const CLEAR: u16 = 1 << 1;

/// A refusal, of as many bytes as are announced.
type Refusal = OutputLine<120>;

/// The run command of the bus.
#[derive(Clone, Copy, Default, PartialEq)]
enum Order {
    /// None, or a stop.
    #[default]
    Stop,
    /// A start was taken; the controllers are being designed.
    Starting,
    /// The drive runs for the bus.
    Run,
    /// The drive has stopped for another reason.
    Ended,
}

/// What the console knows of the bus.
#[derive(Default)]
pub(super) struct Bus {
    order: Order,
    reverse: bool,
    /// The frequency that was written last, 0.01 Hz.
    frequency: u16,
    /// The speed that the drive was given last since its start, rpm.
    given: Option<f32>,
    /// Whether the task of the console is the bus's.
    has_task: bool,
    /// Whether controllers were designed, which takes so long that the master has given up a request.
    late: bool,
    /// Whether what the console says is an answer to the bus, and whether it was an error.
    quiet: bool,
    failed: bool,
    faults: FaultLog,
    seconds: u32,
    second_ms: u32,
    /// The last refusal, and whether it is still to be announced.
    refusal: Refusal,
    fresh: bool,
}

impl Bus {
    /// Whether the task of the console is the bus's.
    pub(super) fn has_task(&self) -> bool {
        self.has_task
    }

    /// Notes that controllers were designed.
    pub(super) fn designed(&mut self) {
        self.late = true;
    }

    /// The refusal that is to be announced, once.
    pub(super) fn news(&mut self) -> Option<&str> {
        core::mem::take(&mut self.fresh).then_some(self.refusal.as_str())
    }

    /// Takes an error of the console, if it is an answer to the bus; whether it was.
    pub(super) fn takes_error(&mut self, why: &dyn fmt::Display) -> bool {
        if self.quiet {
            self.failed = true;
            self.refused(why);
        }
        self.quiet
    }

    /// Notes a refusal; a master that repeats itself is announced once.
    fn refused(&mut self, why: &dyn fmt::Display) {
        let mut text = Refusal::default();
        // What is too long is cut off.
        let _ = write!(text, "{why}");
        self.fresh |= text.as_str() != self.refusal.as_str();
        self.refusal = text;
    }

    fn command(&self) -> u16 {
        let direction = if self.reverse { REVERSE } else { FORWARD };
        if matches!(self.order, Order::Run | Order::Starting) { RUN | direction } else { STOP }
    }
}

impl Console {
    /// Answers a frame of the bus, if there is one, and follows its orders; never waits. `now_ms` wraps.
    #[inline(never)]
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
            let _ = self.quietly(|console| console.perform(task, drive, now_ms));
        }
        // A task of the console comes first.
        if self.task.is_some() {
            return;
        }
        self.follow_order(drive);
        let frame = port.receive();
        // An answer to a request that the master has given up would be taken for that to another.
        let late = core::mem::take(&mut self.bus.late);
        let Some(frame) = frame.filter(|_| !late) else { return };
        let mut access = Access { console: self, drive };
        // The setting is 1 to 247.
        let own = settings.address as u8;
        if slave::answer(&frame, own, &mut access, |answer| port.send(answer)) {
            self.heard(Commander::Bus, now_ms);
        }
    }

    /// Gives the drive the speed of a run command, and ends the command if the drive has stopped.
    fn follow_order(&mut self, drive: &mut impl DriveHandle) {
        let stopping = drive.status().is_some_and(|s| s.state.is_stopping());
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
        let rpm = f32::from(self.bus.frequency) * 60.0 / (100.0 * pole_pairs);
        let rpm = if self.bus.reverse { -rpm } else { rpm };
        if self.bus.given == Some(rpm) {
            return Ok(());
        }
        self.bus.given = Some(rpm);
        self.quietly(|console| console.give(Command::Speed(rpm), "rpm", drive))
    }

    /// Begins a task. What takes long is done when the answer is on its way.
    fn begin_task(&mut self, task: Task, drive: &mut impl DriveHandle) -> Result<(), Exception> {
        self.quietly(|console| {
            let off = drive.is_off();
            if off && !console.may_begin(task, drive) {
                return;
            }
            match task {
                // The drive says why it does not start.
                Task::Start(mode) if !off => console.start(mode, drive),
                // Nothing to be put in force.
                Task::Start(mode) if !console.settings.is_staged() && !console.designs(task) => {
                    console.start(mode, drive);
                }
                _ if !off => console.error(&MUST_BE_OFF),
                _ => (console.task, console.bus.has_task) = (Some(task), true),
            }
        })
    }

    /// Does something whose answer is not for the console's wire. A refusal is announced.
    fn quietly(&mut self, work: impl FnOnce(&mut Self)) -> Result<(), Exception> {
        (self.bus.quiet, self.bus.failed) = (true, false);
        self.out.mute(true);
        work(self);
        self.out.mute(false);
        self.bus.quiet = false;
        if self.bus.failed { Err(Exception::ServerDeviceFailure) } else { Ok(()) }
    }

    fn run(&mut self, drive: &mut impl DriveHandle) -> Result<(), Exception> {
        match self.bus.order {
            Order::Starting => Ok(()),
            Order::Run => self.refer(drive),
            Order::Ended => {
                self.bus.refused(&"the drive has stopped for another reason: write a stop first");
                Err(Exception::ServerDeviceFailure)
            }
            Order::Stop => {
                self.begin_task(Task::Start(Mode::Speed), drive)?;
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
        if word & !(ACTION | FORWARD | REVERSE) != 0 || word & ACTION == ACTION {
            return Err(Exception::IllegalDataValue);
        }
        let commands = self.console.settings.latest().bus.commander == Commander::Bus;
        // Anybody may stop the drive. A release by a master that does not command changes nothing.
        if word & ACTION == STOP || (word == 0 && commands) {
            return self.stop(Stop::Coast);
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

    /// A control word of CiA 402. A run keeps the direction.
    fn control(&mut self, word: u16) -> Result<(), Exception> {
        if word & cia402::FAULT_RESET != 0 {
            self.clear()?;
        }
        match cia402::stop(word) {
            Some(stop) => self.stop(stop),
            None => self.command(RUN),
        }
    }

    fn stop(&mut self, stop: Stop) -> Result<(), Exception> {
        self.console.bus.order = Order::Stop;
        let stopped = self.drive.command(Command::Stop(stop));
        stopped.map(|_| ()).or(Err(Exception::ServerDeviceFailure))
    }

    fn clear(&mut self) -> Result<(), Exception> {
        self.may_command()?;
        self.console.quietly(|console| console.give(Command::Clear, "", self.drive))
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
        self.console.bus.refused(&"the console commands: `set bus.commands bus` lets the bus");
        Err(Exception::ServerDeviceFailure)
    }

    /// Stages settings, whole ones.
    fn stage(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception> {
        self.may_command()?;
        let first = usize::from(at - SETTINGS);
        if !first.is_multiple_of(2) || !words.count().is_multiple_of(2) || words.count() > 2 * MOST
        {
            return Err(Exception::IllegalDataValue);
        }
        let mut values = Assignments::new();
        for n in 0..words.count() / 2 {
            let key = keys::number(first / 2 + n).ok_or(Exception::IllegalDataAddress)?;
            let half = |place| u32::from(words.get(2 * n + place).unwrap_or(0));
            let float = f32::from_bits(half(0) << 16 | half(1));
            if key.hardware() {
                let name = key.name();
                self.console.bus.refused(&format_args!(
                    "{name} belongs to the hardware: set it at the console"
                ));
                return Err(Exception::ServerDeviceFailure);
            }
            // There is room.
            let _ = values.push((key, from_float(key, self.console.settings.latest(), float)?));
        }
        let taken = self.console.quietly(|console| console.set(&values, self.drive));
        // While it is off, only a value can be wrong.
        if self.drive.is_off() { taken.or(Err(Exception::IllegalDataValue)) } else { taken }
    }

    fn staged(&mut self, word: u16) -> Result<(), Exception> {
        self.may_command()?;
        match word {
            1 => self.console.begin_task(Task::Apply, self.drive),
            2 => self.console.begin_task(Task::Save, self.drive),
            3 => {
                self.console.settings.revert();
                Ok(())
            }
            _ => Err(Exception::IllegalDataValue),
        }
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

    fn write(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception> {
        let word = words.get(0).unwrap_or(0);
        match (at, words.get(1)) {
            (SETTINGS..SETTINGS_END, _) => self.stage(at, words),
            // The frequency first: a run command begins with it.
            (COMMAND, Some(frequency)) if words.count() == 2 => {
                if word & ACTION == RUN {
                    self.frequency(frequency)?;
                }
                self.command(word)
            }
            (COMMAND, None) => self.command(word),
            (FREQUENCY, None) => self.frequency(word),
            (RESET, None) => match word {
                0 => Ok(()),
                CLEAR => self.clear(),
                _ => Err(Exception::IllegalDataValue),
            },
            (CONTROL, None) => self.control(word),
            (STAGED, None) => self.staged(word),
            _ => Err(Exception::IllegalDataAddress),
        }
    }
}
