//! The field bus as an interface of the command arbiter: registers to requests, refusals to exceptions.
//!
//! A run command holds until a stop. If the drive has stopped for another reason (console, time-out, fault), a master that repeats its
//! run command starts it again only after it has written a stop.

use drive_core::{Mode, Stage, State, Stop};
use modbus_core::Exception;

use super::Port;
use super::cia402::{self, Event, Power};
use super::faults::FaultLog;
use super::float::from_float;
use super::registers::{
    COMMAND, CONTROL, FREQUENCY, MODE, RESET, RUN, SETTINGS, STAGED, VELOCITY, View,
};
use super::settings::{Alive, Settings, StopBy};
use super::slave::{self, Registers, Words, Written};
use crate::desk::Desk;
use crate::desk::handle::DriveHandle;
use crate::desk::order::{Order, Refusal};
use crate::settings::Commander;
use crate::settings::keys;
use crate::settings::staging::{Assignments, MOST, SetError};

/// Fields of the command word: the action and the direction. Other bits are refused.
const ACTION: u16 = 0b11;
const STOP: u16 = 1;
const FORWARD: u16 = 1 << 4;
const REVERSE: u16 = 1 << 5;
/// Bits of the reset register: clear the latched fault; base block, which switches the outputs off at once.
const CLEAR: u16 = 1 << 1;
const BASE_BLOCK: u16 = 1 << 2;
/// Time between two looks at the speed, ms.
const LOOKS_MS: u32 = 10;

/// Whether a write is a stop, which acts also while the drive is busy.
pub fn is_stop((at, word): Written) -> bool {
    match at {
        // A release is a stop if the bus commands.
        COMMAND => word & ACTION == STOP || word == 0,
        RESET => word & BASE_BLOCK != 0,
        CONTROL => Event::of(word) != Event::EnableOperation,
        _ => false,
    }
}

/// A condition that is told once it has lasted for a while.
#[derive(Default)]
struct Lasting {
    since_ms: Option<u32>,
    told: bool,
}

impl Lasting {
    fn follow(&mut self, is: bool, now_ms: u32, for_s: f32) {
        self.since_ms = is.then(|| self.since_ms.unwrap_or(now_ms));
        self.told = self.since_ms.is_some_and(|at| now_ms.wrapping_sub(at) as f32 >= 1e3 * for_s);
    }
}

/// The field bus, see the head of the module.
#[derive(Default)]
pub struct Bus {
    /// The state of CiA 402 that the master's commands have led to. In [`Power::OperationEnabled`] a run command is in force.
    power: Power,
    /// Whether the drive has stopped during a run command, not by a stop of the bus. A run then needs a stop first.
    ended: bool,
    reverse: bool,
    /// The frequency that was written last, 0.01 Hz.
    frequency: u16,
    /// The speed that the drive was given last since its start, rpm.
    given: Option<f32>,
    /// Number of the arbiter's last design that was noticed.
    designs: u8,
    /// Whether the last control word of CiA 402 has the fault-reset bit: only the change to it resets a fault.
    resets: bool,
    at_speed: Lasting,
    standstill: Lasting,
    looked_ms: u32,
    /// Time at which a request was seen that waits for the delay before its answer, ms.
    asked_ms: Option<u32>,
    faults: FaultLog,
    seconds: u32,
    second_ms: u32,
}

impl Bus {
    /// Notes that a design has ended: a frame that comes from here on is not from before it.
    pub fn end_design(&mut self, desk: &Desk) {
        desk.has_designed(&mut self.designs);
    }

    /// Answers a frame of the bus, if there is one, and follows its run command; never waits. `now_ms` wraps.
    #[inline(never)] // its stack does not add to that of a design
    pub fn serve(
        &mut self,
        port: &mut impl Port,
        desk: &mut Desk,
        drive: &mut impl DriveHandle,
        now_ms: u32,
    ) {
        let settings = desk.settings().in_force().modules.bus;
        port.set_line(&settings);
        while now_ms.wrapping_sub(self.second_ms) >= 1000 {
            self.second_ms = self.second_ms.wrapping_add(1000);
            self.seconds += 1;
        }
        let state = drive.status().map(|status| status.state);
        if let Some(state) = state {
            self.faults.watch(state, self.seconds);
        }
        self.follow_drive(state, desk);
        if !desk.is_busy() {
            self.follow_run(desk, drive);
        }
        // Seldom, because a pass of the main loop must be shorter than a byte of the console.
        if now_ms.wrapping_sub(self.looked_ms) >= LOOKS_MS {
            self.looked_ms = now_ms;
            let view = self.view(desk, drive);
            let (reached, rests) = (view.is_at_reference(), view.is_at_standstill());
            self.at_speed.follow(reached, now_ms, settings.steady_s);
            self.standstill.follow(rests, now_ms, settings.steady_s);
        }
        // The request itself waits: its answer could not be kept without the memory of a frame.
        let asked_ms = &mut self.asked_ms;
        let frame = port.receive(|| {
            let waited_ms = now_ms.wrapping_sub(*asked_ms.get_or_insert(now_ms));
            waited_ms as f32 >= 1e3 * settings.delay_s
        });
        self.asked_ms = self.asked_ms.filter(|_| frame.is_none());
        // The master has given up a request from before a design. An answer would be taken for the answer to another request.
        let late = desk.has_designed(&mut self.designs);
        let mut access = Access { bus: self, desk, drive, commanded: false };
        match frame {
            // A busy slave carries out a stop all the same.
            Some(frame) if late || access.desk.is_busy() => {
                let (answer, stop) = slave::busy(&frame, settings.own(), is_stop);
                answer.iter().filter(|_| !late).for_each(|answer| port.send(answer));
                stop.iter().for_each(|stop| access.carry_out(*stop));
            }
            Some(frame) => {
                let own = settings.own();
                let valid = slave::answer(&frame, own, &mut access, |answer| port.send(answer));
                // By default only commands count as a sign of life of the master: neither a panel that only reads nor a gateway that
                // broadcasts replaces it.
                if valid && (access.commanded || settings.alive == Alive::Any) {
                    access.desk.note_activity(Commander::Bus, now_ms);
                }
            }
            None => {}
        }
        // The stop is carried out after the frame, which came before it.
        if let Some(stop) = port.take_stop() {
            access.carry_out(stop);
        }
    }

    fn view<'a>(&'a self, desk: &'a Desk, drive: &impl DriveHandle) -> View<'a> {
        let (status, settings) = (drive.status(), desk.settings().in_force());
        View {
            status,
            desk,
            settings,
            command: self.command(),
            power: self.shown(status.map(|status| status.state)),
            at_speed: self.at_speed.told,
            standstill: self.standstill.told,
            frequency: self.frequency,
            faults: &self.faults,
            seconds: self.seconds,
        }
    }

    /// Follows what happens to the drive without a command of the bus.
    fn follow_drive(&mut self, state: Option<State>, desk: &Desk) {
        let settings = desk.settings().in_force();
        let may_start =
            settings.command.commander == Commander::Bus && settings.board_is_confirmed();
        let stage = state.map(State::stage);
        let stopped = self.power == Power::QuickStopActive
            && stage == Some(Stage::Off)
            && !settings.modules.bus.quick_stop.reaction().1;
        let events = [
            (stage.is_some(), Event::Ready),
            (stage == Some(Stage::Fault), Event::Failed),
            (stage != Some(Stage::Fault), Event::Cleared),
            (stopped || !may_start, Event::Stopped),
        ];
        let ran = self.runs();
        for (_, event) in events.into_iter().filter(|(happened, _)| *happened) {
            self.power = cia402::after(self.power, event);
        }
        self.ended |= ran && !self.runs();
    }

    /// The state that the master reads: that of the drive, and while it is off, the state to which commands have led.
    fn shown(&self, state: Option<State>) -> Power {
        match (state.map(State::stage), self.power) {
            (None, _) => Power::NotReadyToSwitchOn,
            (Some(Stage::Fault), _) => Power::Fault,
            (Some(Stage::Running), _) => Power::OperationEnabled,
            (Some(Stage::Starting), _) | (Some(Stage::Off), Power::OperationEnabled) => {
                Power::SwitchedOn
            }
            // A stop by ramp still regulates.
            (Some(Stage::Stopping), Power::ReadyToSwitchOn | Power::SwitchedOn) => {
                Power::OperationEnabled
            }
            (Some(Stage::Stopping), _) => Power::QuickStopActive,
            (Some(Stage::Off), power) => power,
        }
    }

    /// Whether a run command is in force.
    fn runs(&self) -> bool {
        self.power == Power::OperationEnabled
    }

    /// Gives the drive the speed of a run command, and ends the command if the drive has stopped.
    fn follow_run(&mut self, desk: &mut Desk, drive: &mut impl DriveHandle) {
        if !self.runs() {
            return;
        }
        if drive.is_off() || drive.is_stopping() {
            self.ended = true;
            self.power = cia402::after(self.power, Event::Stopped);
        } else {
            // The answer has been given; a refusal is announced.
            let _ = self.send_reference(desk, drive);
        }
    }

    /// Gives the drive the speed, if it has changed.
    fn send_reference(
        &mut self,
        desk: &mut Desk,
        drive: &mut impl DriveHandle,
    ) -> Result<(), Refusal> {
        let pole_pairs = f32::from(desk.settings().in_force().drive.motor.pole_pairs);
        let rpm = f32::from(self.frequency) * 60.0 / (100.0 * pole_pairs);
        let rpm = if self.reverse { -rpm } else { rpm };
        if self.given == Some(rpm) {
            return Ok(());
        }
        self.given = Some(rpm);
        desk.order(Commander::Bus, Order::Speed(rpm), drive).map(drop)
    }

    fn command(&self) -> u16 {
        let direction = if self.reverse { REVERSE } else { FORWARD };
        if self.runs() { RUN | direction } else { STOP }
    }
}

/// A refusal is a failure of the device, unless it is about a value.
impl From<Refusal> for Exception {
    fn from(why: Refusal) -> Self {
        match why {
            Refusal::Set(SetError::Board(_) | SetError::Range(_)) => Self::IllegalDataValue,
            _ => Self::ServerDeviceFailure,
        }
    }
}

/// The registers, with the drive behind them.
struct Access<'a, D> {
    bus: &'a mut Bus,
    desk: &'a mut Desk,
    drive: &'a mut D,
    /// Whether command, frequency or control word were written and accepted.
    commanded: bool,
}

impl<D: DriveHandle> Access<'_, D> {
    fn order(&mut self, order: Order) -> Result<(), Exception> {
        Ok(self.desk.order(Commander::Bus, order, self.drive).map(drop)?)
    }

    /// Carries out a stop that has been acknowledged already, or whose master no longer waits.
    fn carry_out(&mut self, (at, word): Written) {
        // The arbiter shows a refusal at the console.
        let _ = self.write_word(at, word);
    }

    fn refuse(&mut self, why: Refusal) -> Result<(), Exception> {
        self.desk.note_refusal(Commander::Bus, why.clone());
        Err(why.into())
    }

    /// Writes a register that is not a setting.
    fn write_word(&mut self, at: u16, word: u16) -> Result<(), Exception> {
        match at {
            COMMAND => self.command(word),
            FREQUENCY => self.frequency(word),
            RESET => self.reset(word),
            CONTROL => self.control(word),
            MODE if word == VELOCITY => Ok(()),
            MODE => Err(Exception::IllegalDataValue),
            STAGED => self.staged(word),
            _ => Err(Exception::IllegalDataAddress),
        }?;
        self.commanded |= matches!(at, COMMAND | FREQUENCY | CONTROL);
        Ok(())
    }

    fn reset(&mut self, word: u16) -> Result<(), Exception> {
        if word & !(CLEAR | BASE_BLOCK) != 0 {
            return Err(Exception::IllegalDataValue);
        }
        if word & BASE_BLOCK != 0 {
            return self.stop(Stop::Now, Event::DisableVoltage);
        }
        if word == CLEAR { self.order(Order::Clear) } else { Ok(()) }
    }

    fn command(&mut self, word: u16) -> Result<(), Exception> {
        if word & !(ACTION | FORWARD | REVERSE) != 0 || word & ACTION == ACTION {
            return Err(Exception::IllegalDataValue);
        }
        let commands = self.desk.commander() == Commander::Bus;
        // Anybody may stop the drive. A release by a master that does not command changes nothing.
        if word & ACTION == STOP || (word == 0 && commands) {
            let coasts = self.settings().stop == StopBy::Coast;
            let stop = if coasts { Stop::Coast } else { Stop::Ramp };
            return self.stop(stop, Event::Shutdown);
        }
        if word == 0 {
            return Ok(());
        }
        self.may_command()?;
        self.bus.reverse = match word & (FORWARD | REVERSE) {
            0 => self.bus.reverse,
            FORWARD => false,
            REVERSE => true,
            _ => !self.bus.reverse,
        };
        match word & ACTION {
            RUN => self.run(),
            _ => self.refer(),
        }
    }

    /// Gives a run the speed, if one is in force.
    fn refer(&mut self) -> Result<(), Exception> {
        if self.bus.runs() { Ok(self.bus.send_reference(self.desk, self.drive)?) } else { Ok(()) }
    }

    fn run(&mut self) -> Result<(), Exception> {
        if self.bus.ended {
            return self.refuse(Refusal::Ended);
        }
        if self.bus.runs() {
            return self.refer();
        }
        self.order(Order::Start(Mode::Speed))?;
        (self.bus.power, self.bus.given) = (Power::OperationEnabled, None);
        Ok(())
    }

    /// Carries out a control word of CiA 402. A run keeps the direction.
    fn control(&mut self, word: u16) -> Result<(), Exception> {
        let resets = word & cia402::FAULT_RESET != 0;
        let before = core::mem::replace(&mut self.bus.resets, resets);
        if resets && !before {
            self.order(Order::Clear)?;
            self.bus.power = cia402::after(self.bus.power, Event::Cleared);
        }
        let event = Event::of(word);
        match event {
            Event::DisableVoltage => self.stop(Stop::Now, event),
            Event::QuickStop => self.stop(self.settings().quick_stop.reaction().0, event),
            Event::Shutdown => self.stop(Stop::Ramp, event),
            _ => self.enable(event),
        }
    }

    /// Carries out *switch on* and *enable operation*, if the state has a transition for them.
    fn enable(&mut self, event: Event) -> Result<(), Exception> {
        let (state, (_, stays)) = (self.state(), self.settings().quick_stop.reaction());
        // Without such an option code, a quick stop goes on to its end.
        let ends = state == Power::QuickStopActive && !stays;
        match if ends { state } else { cia402::after(state, event) } {
            Power::NotReadyToSwitchOn | Power::SwitchOnDisabled | Power::QuickStopActive => {
                self.may_command()?;
                self.refuse(Refusal::Ended)
            }
            // While the drive runs, the same bits disable the operation.
            _ if event == Event::SwitchOn => self.stop(Stop::Ramp, event),
            // The drive refuses a start with a latched fault and names it.
            _ => self.run(),
        }
    }

    /// The state to which the transitions apply: a drive that another interface runs is enabled.
    fn state(&self) -> Power {
        match (self.bus.power, self.drive.status().map(|status| status.state.stage())) {
            (Power::SwitchOnDisabled, Some(Stage::Starting | Stage::Running)) => {
                Power::OperationEnabled
            }
            (power, _) => power,
        }
    }

    fn settings(&self) -> Settings {
        self.desk.settings().in_force().modules.bus
    }

    /// Stops the drive, whatever its state, and follows the command's transition.
    fn stop(&mut self, stop: Stop, event: Event) -> Result<(), Exception> {
        self.bus.ended = false;
        self.bus.power = cia402::after(self.state(), event);
        self.order(Order::Stop(stop))
    }

    fn frequency(&mut self, word: u16) -> Result<(), Exception> {
        self.may_command()?;
        self.bus.frequency = word;
        self.refer()
    }

    fn may_command(&mut self) -> Result<(), Exception> {
        match self.desk.commander() {
            Commander::Bus => Ok(()),
            other => self.refuse(Refusal::Authority(other)),
        }
    }

    /// Stages settings, each written completely.
    fn stage(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception> {
        self.may_command()?;
        let first = at - SETTINGS;
        if !first.is_multiple_of(2) || !words.count().is_multiple_of(2) || words.count() > 2 * MOST
        {
            return Err(Exception::IllegalDataValue);
        }
        let mut values = Assignments::new();
        for n in 0..words.count() / 2 {
            let key = keys::find_id(first / 2 + n as u16).ok_or(Exception::IllegalDataAddress)?;
            let half = |place| u32::from(words.get(2 * n + place).unwrap_or(0));
            let float = f32::from_bits(half(0) << 16 | half(1));
            if key.hardware() {
                return self.refuse(Refusal::Hardware(key));
            }
            // The list has enough space.
            let _ = values.push((key, from_float(key, self.desk.settings().latest(), float)?));
        }
        self.desk.set(Commander::Bus, &values, self.drive).map(drop).or_else(|why| self.refuse(why))
    }

    fn staged(&mut self, word: u16) -> Result<(), Exception> {
        match word {
            1 | 2 if !self.drive.is_off() => {
                self.may_command()?;
                self.refuse(Refusal::MustBeOff)
            }
            1 => self.order(Order::Apply),
            2 => self.order(Order::Save),
            3 => self.order(Order::Revert),
            _ => Err(Exception::IllegalDataValue),
        }
    }
}

impl<D: DriveHandle> Registers for Access<'_, D> {
    fn read(&mut self, at: u16) -> Result<u16, Exception> {
        self.bus.view(self.desk, self.drive).read(at)
    }

    fn write(&mut self, at: u16, words: Words<'_>) -> Result<(), Exception> {
        let word = words.get(0).unwrap_or(0);
        match (at, words.get(1)) {
            (SETTINGS..STAGED, _) => self.stage(at, words),
            // The frequency is written first, because a run command begins with it.
            (COMMAND, Some(frequency)) if words.count() == 2 => {
                if word & ACTION == RUN {
                    self.frequency(frequency)?;
                }
                self.write_word(at, word)
            }
            (_, None) => self.write_word(at, word),
            _ => Err(Exception::IllegalDataAddress),
        }
    }
}
