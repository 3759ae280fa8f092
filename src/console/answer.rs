//! The answer to a request.

use core::fmt;

use drive_commission::Step;
use drive_core::{Accepted, Command, Mode, State};
use drive_settings::entry::Change;
use thiserror::Error;

use super::design::configure;
use super::grammar::Request;
use super::handle::DriveHandle;
use super::list::ListKind;
use super::number::Significant;
use super::{Console, reply};
use crate::link::trace::{Plan, SIGNALS, Trigger};
use crate::settings::FirmwareSettings;
use crate::settings::staging::{Applied, Assignments, UNCONFIRMED};

/// Work that takes long, or has to wait until the answer is sent.
#[derive(Clone, Copy)]
pub(super) enum Task {
    /// Put the staged settings in force.
    Apply,
    /// The same, then start.
    Start(Mode),
    /// The same, then commission: from this step to that.
    Commission(Step, Step),
    /// The same, then learn: anew, or again at another rotor position.
    Learn { again: bool },
    /// The same, then save.
    Save,
    /// Reset the chip this long after the answer, since this time, ms.
    Reboot(Option<u32>),
}

/// From the answer to a reset, ms: the transmit queue empties in 44.
const REBOOT_MS: u32 = 100;
/// Significant digits of a limited reference.
const DIGITS: usize = 4;

impl Console {
    #[inline(never)]
    pub(super) fn answer(&mut self, request: Request, drive: &mut impl DriveHandle) {
        match request {
            Request::Help => self.begin(ListKind::Help),
            Request::Status => self.status(drive),
            Request::Start(mode) => self.design_for(Task::Start(mode), drive),
            Request::Learn { again } => self.design_for(Task::Learn { again }, drive),
            Request::Commission(first, last) => {
                self.design_for(Task::Commission(first, last), drive);
            }
            Request::Accept => self.accept(drive),
            Request::Stop(stop) => {
                self.announcer.stopping();
                self.give(Command::Stop(stop), "", drive);
            }
            Request::Relock => self.give(Command::Relock, "", drive),
            Request::Torque(i_q) => self.give(Command::Torque(i_q), "A", drive),
            Request::Speed(rpm) => self.give(Command::Speed(rpm), "rpm", drive),
            Request::Jog(rpm) => self.give(Command::Jog(rpm), "rpm", drive),
            Request::Position(turns) => {
                self.homing = None;
                self.give(Command::Position(turns), "turns", drive);
            }
            Request::Home(plan) => self.home(plan, drive),
            Request::Clear => self.give(Command::Clear, "", drive),
            Request::Set(values) => self.set(&values, drive),
            Request::Defaults => {
                if self.may_stage(drive) {
                    self.settings.set_defaults();
                    self.staged();
                }
            }
            Request::Apply if !self.settings.is_staged() => {
                self.out.answer(format_args!("ok: nothing staged"));
            }
            Request::Apply => self.design_for(Task::Apply, drive),
            Request::Revert => {
                self.foreign = None;
                let count = self.settings.count();
                self.settings.revert();
                self.out.answer(format_args!("ok: {count} staged values dropped"));
            }
            Request::Save => self.design_for(Task::Save, drive),
            Request::Get(key) => {
                let setting = reply::Setting::new(key, &self.settings);
                self.out.answer(format_args!("{setting}; {}", key.help()));
            }
            Request::List(prefix) => self.begin(ListKind::Settings(prefix)),
            Request::Describe(prefix) => self.begin(ListKind::Describe(prefix)),
            Request::Backup if self.settings.is_staged() => self.error(&STAGED),
            Request::Backup => self.begin(ListKind::Backup),
            Request::Learned => {
                if self.unbelievable.is_some() || self.settings.in_force().learned.is_some() {
                    self.begin(ListKind::Learned);
                } else {
                    self.out.answer(format_args!("ok: nothing learned with these settings"));
                }
            }
            Request::Restore(index, words) => match self.restore.take(index, &words) {
                Ok(()) => self.ok(),
                Err(why) => self.error(&why),
            },
            Request::Restored(check) => {
                if !self.may_stage(drive) {
                    return;
                }
                let both = self.settings.latest().drive.scales.both_zero_vectors;
                match self.restore.finish(check, both) {
                    Ok(learned) => {
                        self.settings.restore(learned);
                        self.staged();
                    }
                    Err(why) => self.error(&why),
                }
            }
            Request::Faults(fault) => self.faults(fault, drive),
            Request::History => self.begin(ListKind::History),
            Request::Trace(plan) => self.trace(plan, drive),
            Request::ShowTrace if drive.tracing() => {
                self.error(&"a trace is being recorded; `trace off` ends it");
            }
            Request::ShowTrace if self.traced.is_none() => self.error(&"no trace was recorded"),
            Request::ShowTrace => self.begin(ListKind::Trace),
            Request::EndTrace => {
                drive.cancel_trace();
                (self.armed, self.traced) = (false, None);
                self.ok();
            }
            Request::Stream(plan) => self.stream(plan, drive),
            Request::StreamState => self.stream_state(),
            Request::EndStream => self.end_stream(drive),
            Request::Signals => self.begin(ListKind::Signals),
            Request::Baud(baud) => self.baud(baud, drive),
            Request::Log(level) => {
                drive.set_log_level(level);
                self.ok();
            }
            Request::Echo(on) => {
                self.settings.note(|settings| settings.command.echo = on);
                self.unsaved = true;
                self.ok();
            }
            Request::Reboot(now) => self.reboot(now, drive),
            Request::Board => self.begin(ListKind::Board),
            Request::BoardIs(board) => {
                let own = self.settings.in_force().board;
                self.foreign = (board != own).then_some(board.name);
                match self.foreign {
                    Some(other) => self.error(&WrongBoard(other, own.name)),
                    None => self.ok(),
                }
            }
            Request::Confirm if !drive.is_off() => self.error(&MUST_BE_OFF),
            Request::Confirm if self.settings.is_staged() => self.error(&STAGED),
            Request::Confirm => {
                self.settings.note(FirmwareSettings::confirm_board);
                let boot_pin = self.settings.in_force().boot_pin_counts;
                self.save(if boot_pin { BOOT_PIN } else { "" }, drive);
            }
            Request::Version => {
                let version = fmt::from_fn(|f| drive.version(f));
                self.out.answer(format_args!("{version}"));
            }
        }
    }

    /// Gives the drive a command; `unit` is that of its reference.
    pub(super) fn give(&mut self, command: Command, unit: &str, drive: &mut impl DriveHandle) {
        match drive.command(command) {
            Ok(Accepted::AsGiven) => self.ok(),
            Ok(Accepted::Limited(value)) => {
                let value = Significant(value, DIGITS);
                self.out.answer(format_args!("ok: limited to {value} {unit}"));
            }
            Err(why) => self.error(&why),
        }
    }

    /// Whether settings may be staged now; answers if not.
    pub(super) fn may_stage(&mut self, drive: &impl DriveHandle) -> bool {
        if drive.status().is_none() {
            self.error(&drive.no_control());
        } else if !drive.is_off() {
            self.error(&MUST_BE_OFF);
        } else {
            return true;
        }
        false
    }

    pub(super) fn set(&mut self, values: &Assignments, drive: &impl DriveHandle) {
        if !self.may_stage(drive) {
            return;
        }
        let late = values.iter().find(|(key, _)| key.change() == Change::FromReset);
        let confirmed = self.settings.latest().board_is_confirmed();
        match self.settings.set(values) {
            Err(why) => self.error(&why),
            Ok(true) => {
                let what = "what was restored belongs to other settings and is dropped";
                self.out.answer(format_args!("ok: staged; {what}"));
            }
            Ok(false) => match late {
                Some((key, _)) if self.settings.is_staged() => {
                    let when = "takes effect at the next reset, if saved";
                    self.out.answer(format_args!("ok: staged; {} {when}", key.name()));
                }
                _ if confirmed && !self.settings.latest().board_is_confirmed() => {
                    self.out.answer(format_args!("ok: staged; {UNCONFIRMED}"));
                }
                _ => self.staged(),
            },
        }
    }

    fn staged(&mut self) {
        let text = if self.settings.is_staged() { "staged" } else { "as in force" };
        self.out.answer(format_args!("ok: {text}"));
    }

    /// Performs a task that needs the staged settings in force. The design of the controllers takes more than a moment:
    /// the console says so first, and does it when that is on its way.
    pub(super) fn design_for(&mut self, task: Task, drive: &mut impl DriveHandle) {
        match task {
            // The drive says why it does not start.
            Task::Start(mode) if !drive.is_off() => self.start(mode, drive),
            Task::Learn { .. } if !drive.is_off() => self.start(Mode::Learning, drive),
            _ if !self.may_begin(task, drive) => {}
            _ if self.designs(task) && drive.status().is_some() => {
                self.out.news(format_args!("designing..."));
                self.task = Some(task);
            }
            _ => self.perform(task, drive, 0),
        }
    }

    /// Whether a task needs the controllers designed.
    pub(super) fn designs(&self, task: Task) -> bool {
        let learned = self.settings.in_force().learned.is_some();
        self.settings.needs_design() || (matches!(task, Task::Learn { again: false }) && learned)
    }

    /// Whether a task may begin now; answers if not.
    pub(super) fn may_begin(&mut self, task: Task, drive: &impl DriveHandle) -> bool {
        let in_force = self.settings.in_force();
        match task {
            _ if !drive.is_off() => self.error(&MUST_BE_OFF),
            _ if let Some(other) = self.foreign => {
                self.error(&WrongBoard(other, in_force.board.name));
            }
            Task::Start(_) | Task::Learn { .. } | Task::Commission(..)
                if !self.settings.latest().board_is_confirmed() =>
            {
                self.error(&NOT_CONFIRMED);
            }
            _ => return true,
        }
        false
    }

    /// Performs a task.
    pub(super) fn perform(&mut self, task: Task, drive: &mut impl DriveHandle, now_ms: u32) {
        if let Task::Reboot(since) = task {
            let since = since.unwrap_or(now_ms);
            self.task = Some(Task::Reboot(Some(since)));
            if now_ms.wrapping_sub(since) >= REBOOT_MS {
                self.task = None;
                drive.reboot();
            }
            return;
        }
        self.task = None;
        // The time that it takes is not silence of the user.
        (self.heard_ms, self.line_ms) = (None, None);
        let Some(applied) = self.apply(drive) else { return };
        if matches!(task, Task::Apply) {
            return self.out.answer(format_args!("ok{applied}"));
        }
        if applied != Applied::default() {
            self.out.news(format_args!("applied{applied}"));
        }
        match task {
            Task::Start(mode) => self.start(mode, drive),
            Task::Learn { again } => self.learn(again, drive),
            Task::Commission(first, last) => self.commission(first, last, drive),
            _ => self.save("", drive),
        }
    }

    /// Saves the settings in force; `note` follows the `ok`.
    fn save(&mut self, note: &str, drive: &mut impl DriveHandle) {
        match drive.save(self.settings.in_force()) {
            Ok(()) => {
                self.unsaved = false;
                self.out.answer(format_args!("ok{note}"));
            }
            Err(why) => self.error(&why),
        }
    }

    /// Puts the staged settings in force. If they are refused, the drive stays as it is and they stay staged; `None` then,
    /// and it is answered.
    fn apply(&mut self, drive: &mut impl DriveHandle) -> Option<Applied> {
        let designs = self.settings.needs_design();
        let Some(settings) = self.settings.prepare() else { return Some(Applied::default()) };
        if designs {
            self.bus.designed();
            if let Err(why) = configure(drive, settings) {
                self.error(&why);
                return None;
            }
        }
        let applied = self.settings.adopt();
        self.unsaved = true;
        if designs {
            drive.configured(self.settings.in_force());
        }
        Some(applied)
    }

    /// Starts the drive; the first time since the defaults were set with a check of the wiring. With voltage and frequency its
    /// boost is a check at every start.
    pub(super) fn start(&mut self, mode: Mode, drive: &mut impl DriveHandle) {
        if self.settings.in_force().command.wiring_checked || mode == Mode::VoltsPerHertz {
            return self.give(Command::Start(mode), "", drive);
        }
        let began = drive.status().map(|status| status.periods);
        match drive.command(Command::CheckWiring).and_then(|_| drive.command(Command::Start(mode)))
        {
            Ok(_) => {
                self.checking = began;
                self.out.answer(format_args!("ok: the wiring is checked first"));
            }
            Err(why) => self.error(&why),
        }
    }

    fn faults(&mut self, fault: Option<drive_core::Fault>, drive: &impl DriveHandle) {
        if let Some(fault) = fault {
            self.out.line(format_args!("fault {}: {fault}", fault.code()));
            return self.begin(ListKind::Fault(fault));
        }
        let last_run = fmt::from_fn(|f| drive.last_run(f));
        match drive.status().map(|status| status.state) {
            Some(State::Fault(fault)) => {
                let code = fault.code();
                self.out.line(format_args!("latched: fault {code}, {fault}; last run: {last_run}"));
                self.begin(ListKind::Fault(fault));
            }
            _ => self.out.answer(format_args!("none latched; last run: {last_run}")),
        }
    }

    fn trace(&mut self, mut plan: Plan, drive: &mut impl DriveHandle) {
        if let Trigger::Level { signal, level, above } = &mut plan.trigger
            && let Some(signal) = SIGNALS.get(usize::from(*signal))
        {
            let drive_core::Line { gain, offset } = signal.line(&self.settings.in_force().drive);
            if gain == 0.0 {
                return self.error(
                    &"no trigger on it: the board lacks its sensor, or its scale is curved",
                );
            }
            *level = (*level - offset) / gain;
            // A larger current has a smaller code.
            *above ^= gain < 0.0;
        }
        if !drive.begin_trace(&plan) {
            return self.error(&"a trace is being recorded; `trace off` ends it");
        }
        if plan.trigger == Trigger::Now {
            self.begin(ListKind::Trace);
        } else {
            self.armed = true;
            self.out.answer(format_args!("ok: recording until the trigger"));
        }
        self.traced = Some(plan);
    }

    fn reboot(&mut self, now: bool, drive: &impl DriveHandle) {
        if !drive.is_off() {
            self.error(&MUST_BE_OFF);
        } else if !now && (self.unsaved || self.settings.is_staged()) {
            self.error(
                &"settings that were not saved would be lost: `save` first, or `reboot now`",
            );
        } else {
            self.out.answer(format_args!("ok: rebooting"));
            self.task = Some(Task::Reboot(None));
        }
    }
}

/// Settings of another board.
#[derive(Debug, Error)]
#[error("these lines belong to the board {0}, this is {1}; `revert` drops them")]
struct WrongBoard(&'static str, &'static str);

const NOT_CONFIRMED: &str = "the board's polarities, dead time and scales are assumed, or were changed: do the bench steps that `board` lists, then `confirm board`";
const STAGED: &str = "there are staged values: `apply` or `revert` first";
const BOOT_PIN: &str = ": with the boot pin in use, see `board`";
pub(super) const MUST_BE_OFF: &str = "the drive must be off: `stop` first";
