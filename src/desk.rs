//! The command arbiter: decides who commands, which settings are staged, which task runs, and which events to report. It exchanges typed
//! values, neither text nor bytes.
//!
//! Its interfaces are console ([`crate::console`]), field bus ([`crate::modbus`]) and terminals ([`crate::terminals`]). They turn lines,
//! registers and wires into an [`Order`] (a request), and a [`Reply`] or a [`Refusal`] into text and exceptions. Checks, limits and the
//! commander's time-out are the same for all.

pub mod handle;
pub mod news;
pub mod order;
pub mod shaft;
mod stage_faults;
#[cfg(test)]
mod tests;

use drive_commission::Step;
use drive_core::learned::Learned;
use drive_core::{Accepted, Command, Mode, Refused, State, Stop};
use drive_settings::entry::Change;

use crate::boards::Board;
use crate::settings::FirmwareSettings;
use crate::settings::staging::{Applied, Assignments, Staging, guarded};
use crate::settings::{BUS_SILENT_S, Commander};
use crate::{Homing, ModuleState};
use handle::{CommandError, DriveHandle};
use news::{Announcer, News};
use order::{LOADER_DC_LINK_V, Order, Refusal, Reply};
use shaft::Shaft;
use stage_faults::StageFaults;

/// Time from the answer to a reset, ms: the transmit queue empties in 39.
const REBOOT_MS: u32 = 100;

/// The answer to a request.
pub type Answer = Result<Reply, Refusal>;
/// Remarks on settings that a request has put in force, beside its answer.
type Done = (Applied, Answer);

/// See [`Desk::waits`].
const WAITS: u32 = 0xa53c_5a96;

/// A request that takes long and waits until its answer has been sent.
struct Task {
    from: Commander,
    order: Order,
    /// Remarks on its settings, once these are in force.
    applied: Option<Applied>,
}

/// The command arbiter, see the head of the module.
pub struct Desk {
    settings: Staging,
    /// Whether settings in force were changed since they were saved.
    unsaved: bool,
    /// The board of the backup whose lines the console receives, from `board NAME` until they are in force or dropped. `Some(None)` is a
    /// board that this firmware does not know.
    backup_of: Option<Option<&'static Board>>,
    /// Number of its lines that were refused: without them the staged settings are not the ones that were backed up.
    left_out: u16,
    /// The board that the settings in the flash were saved on, if it is not this one. The gates stay unconnected until the user confirms
    /// which of the two boards this is.
    pub saved_on: Option<&'static str>,
    task: Option<Task>,
    /// [`WAITS`] while a task waits. It is a second condition, so that a flipped bit carries out no past request.
    waits: u32,
    /// Time of a request to reset the chip.
    reboot_ms: Option<u32>,
    /// The result of the console's last task, until the console takes it.
    pub(crate) done: Option<Done>,
    /// Number of designs of the controllers, wrapping. A design takes seconds.
    designs: u8,
    announcer: Announcer,
    /// Faults of the power stage, whose clearing is limited.
    stage: StageFaults,
    shaft: Shaft,
    /// Whether the drive was told that there is a brake.
    braked: bool,
    /// Time of the present pass, ms, wrapping.
    now_ms: u32,
    /// Time of the commander's last sign of life; `None` restarts the time-out.
    last_activity_ms: Option<u32>,
    /// A stop after this silence, s, or the reason why the drive did not take it, until it is announced.
    stopped: Option<Result<f32, CommandError>>,
    /// Periods of the status at the start of a wiring check, while the check lasts.
    checking: Option<u32>,
    /// Result of the last self-commissioning, if it is not plausible.
    rejected_learning: Option<Learned>,
    /// Whether a self-commissioning has ended that is not announced yet.
    learned: bool,
    homing: Homing,
    /// The last refusal of bus or terminals, and its source if it is still to be announced.
    refusal: Option<Refusal>,
    refused: Option<Commander>,
    /// State of the modules that the arbiter and the console look at.
    pub(crate) modules: ModuleState,
}

impl Desk {
    /// A command arbiter; the drive has these settings.
    pub fn new(settings: FirmwareSettings) -> Self {
        Self {
            settings: Staging::new(settings),
            unsaved: false,
            backup_of: None,
            left_out: 0,
            saved_on: None,
            task: None,
            waits: 0,
            reboot_ms: None,
            done: None,
            designs: 0,
            announcer: Announcer::default(),
            stage: StageFaults::default(),
            shaft: Shaft::default(),
            braked: false,
            now_ms: 0,
            last_activity_ms: None,
            stopped: None,
            checking: None,
            rejected_learning: None,
            learned: false,
            homing: Homing::default(),
            refusal: None,
            refused: None,
            modules: ModuleState::default(),
        }
    }

    /// The settings, in force and staged.
    pub fn settings(&self) -> &Staging {
        &self.settings
    }

    /// The result of the last self-commissioning: whether it is in use, and the result itself.
    pub fn learned(&self) -> Option<(bool, &Learned)> {
        let in_use = self.settings.in_force().learned.as_ref().map(|result| (true, result));
        self.rejected_learning.as_ref().map(|result| (false, result)).or(in_use)
    }

    /// Whether a task waits: requests are not accepted.
    pub fn is_busy(&self) -> bool {
        self.task.is_some()
    }

    /// Whether controllers were designed, which takes seconds, since the previous call with the same `seen`.
    pub fn has_designed(&self, seen: &mut u8) -> bool {
        core::mem::replace(seen, self.designs) != self.designs
    }

    /// The last refusal of bus or terminals.
    pub fn refusal(&self) -> Option<&Refusal> {
        self.refusal.as_ref()
    }

    /// Notes a refusal of bus or terminals. If a master repeats a refused request, the refusal is announced once.
    pub fn note_refusal(&mut self, from: Commander, why: Refusal) {
        if from == Commander::Terminals || self.refusal.as_ref() != Some(&why) {
            self.refused = Some(from);
        }
        self.refusal = Some(why);
    }

    /// The commander by the staged settings, which a start puts in force.
    pub fn commander(&self) -> Commander {
        self.settings.latest().command.commander
    }

    /// Notes a sign of life: if the commander is silent, the drive stops. `now_ms` wraps.
    pub fn note_activity(&mut self, from: Commander, now_ms: u32) {
        if self.commander() == from {
            self.last_activity_ms = Some(now_ms);
        }
    }

    /// Time for which the commander may be silent before the drive stops, s; 0: no limit. Nobody sees a bus line break, so the bus always
    /// has a limit.
    fn timeout_s(&self) -> f32 {
        let set = self.settings.in_force().command.timeout_s;
        if set == 0.0 && self.commander() == Commander::Bus { BUS_SILENT_S } else { set }
    }

    /// Follows the drive. Called at the beginning of each pass of the main loop. `now_ms` wraps.
    pub fn poll_drive(&mut self, drive: &mut impl DriveHandle, now_ms: u32) {
        self.now_ms = now_ms;
        if let Some(status) = drive.status() {
            self.stage.watch(&status, now_ms);
            self.shaft.watch(&status, self.settings.in_force(), now_ms);
        }
        self.watch_wiring(drive);
        drive.learned(&mut |result| {
            self.settings.learned(result);
            self.unsaved |= result.verdict.is_accepted();
            self.rejected_learning = Some(*result).filter(|result| !result.verdict.is_accepted());
            self.learned = true;
        });
        self.homing.poll(drive);
    }

    /// The speed of the shaft.
    pub fn shaft(&self) -> &Shaft {
        &self.shaft
    }

    /// Stops the drive if the commander is silent for too long. Called at the end of each pass of the main loop, so that lines received
    /// meanwhile are processed first. `now_ms` wraps.
    pub fn watch_silence(&mut self, drive: &mut impl DriveHandle, now_ms: u32) {
        let limit_s = self.timeout_s();
        let silence_ms = now_ms.wrapping_sub(*self.last_activity_ms.get_or_insert(now_ms));
        if limit_s > 0.0 && silence_ms as f32 * 1e-3 > limit_s {
            self.stop_after_silence(limit_s, drive, now_ms);
        }
    }

    /// Stops the drive: no sign of life came for this time, s.
    pub fn stop_after_silence(&mut self, limit_s: f32, drive: &mut impl DriveHandle, now_ms: u32) {
        if !drive.is_off() {
            self.last_activity_ms = Some(now_ms);
            self.announcer.stopped = Some(Commander::Console);
            self.stopped = Some(drive.command(Command::Stop(Stop::Coast)).map(|_| limit_s));
        }
    }

    /// The next event, if there is any.
    pub fn news(&mut self, drive: &mut impl DriveHandle, now_ms: u32) -> Option<News> {
        let status = drive.status()?;
        if let Some(stopped) = self.stopped.take() {
            return Some(News::Stopped(stopped));
        }
        if core::mem::take(&mut self.learned) {
            return Some(News::Learned);
        }
        let settings = &self.settings.in_force().drive;
        self.announcer
            .next(&status, settings, now_ms)
            .or_else(|| drive.session().news().map(News::Commissioning))
            .or_else(|| self.homing.news().map(News::Homed))
            .or_else(|| self.refused.take().map(News::Refused))
    }

    /// Notes when the drive has passed the check of the wiring, so that the check is not repeated.
    fn watch_wiring(&mut self, drive: &impl DriveHandle) {
        let (Some(began), Some(status)) = (self.checking, drive.status()) else { return };
        // A report from before the start does not count.
        if status.state.has_current() && status.periods != began {
            self.settings.note(|settings| settings.command.wiring_checked = true);
            self.unsaved = true;
            self.checking = None;
        }
    }

    /// Carries out a request, or accepts it as a task ([`Reply::Designing`]).
    ///
    /// # Errors
    /// The reason why nothing has changed. A refusal of bus or terminals is announced.
    pub fn order(&mut self, from: Commander, order: Order, drive: &mut impl DriveHandle) -> Answer {
        let answer = if order.is_for_the_commander(from) && self.commander() != from {
            Err(Refusal::Authority(self.commander()))
        } else {
            self.dispatch(from, order, drive)
        };
        if let (Commander::Bus | Commander::Terminals, Err(why)) = (from, &answer) {
            self.note_refusal(from, why.clone());
        }
        answer
    }

    fn dispatch(&mut self, from: Commander, order: Order, drive: &mut impl DriveHandle) -> Answer {
        match order {
            Order::Apply | Order::ApplyRest if !self.settings.is_staged() => {
                self.end_backup(&order).map(|()| Reply::NothingStaged)
            }
            Order::Start(_)
            | Order::Learn { .. }
            | Order::Commission(..)
            | Order::Apply
            | Order::ApplyRest
            | Order::Save => self.design(from, order, drive),
            Order::Accept => self.accept(from, drive),
            Order::Stop(stop) => {
                self.cancel_start(from);
                if !drive.is_off() {
                    self.announcer.stopped = Some(from);
                }
                give(Command::Stop(stop), "", drive)
            }
            Order::Relock => give(Command::Relock, "", drive),
            Order::Torque(i_q) => give(Command::Torque(i_q), "A", drive),
            Order::Speed(rpm) => give(Command::Speed(rpm), "rpm", drive),
            Order::Jog(rpm) => give(Command::Jog(rpm), "rpm", drive),
            Order::Position(turns) => {
                self.homing.cancel();
                give(Command::Position(turns), "turns", drive)
            }
            Order::Home(plan) => {
                let limit_a = self.settings.in_force().drive.current_limit_a();
                self.homing.begin(plan, limit_a, drive).map(|()| Reply::Done)
            }
            Order::Clear => self.clear(drive),
            Order::Defaults => {
                may_stage(drive)?;
                self.saved_on = None;
                // No line before this one counts any more.
                self.left_out = 0;
                self.settings.set_defaults();
                Ok(self.staged())
            }
            Order::Revert => {
                (self.backup_of, self.left_out) = (None, 0);
                let count = self.settings.count();
                self.settings.revert();
                Ok(Reply::Dropped(count))
            }
            Order::Echo(on) => {
                self.settings.note(|settings| settings.command.echo = on);
                self.unsaved = true;
                Ok(Reply::Done)
            }
            Order::Reboot(now) => self.reboot(from, order, now, drive).map(|()| Reply::Rebooting),
            Order::Update => {
                let line = self.settings.in_force().drive.scales.dc_link;
                // Measured now: while the drive is off, its own value is not updated.
                let dc_link = drive.status().map_or(0.0, |status| line.at(status.sample.dc_link));
                if dc_link > LOADER_DC_LINK_V {
                    return Err(Refusal::Charged(dc_link));
                }
                self.reboot(from, order, false, drive).map(|()| Reply::Loader)
            }
            Order::BoardIs(board) => {
                self.backup_of = Some(board);
                self.is_own_board().map(|()| Reply::Done)
            }
            Order::Confirm => {
                must_be_off(drive)?;
                self.nothing_staged()?;
                self.is_own_record()?;
                self.settings.note(FirmwareSettings::confirm_board);
                let boot_pin = self.settings.in_force().boot_pin_counts;
                let reply =
                    self.save(if boot_pin { Reply::BootPin } else { Reply::Done }, drive)?;
                drive.connect();
                Ok(reply)
            }
        }
    }

    /// Clears the latched fault, if it has been reported. A fault that came since then is reported first, and counted.
    fn clear(&mut self, drive: &mut impl DriveHandle) -> Answer {
        let Some(status) = drive.status() else { return give(Command::Clear, "", drive) };
        let latched = self.stage.watch(&status, self.now_ms);
        self.stage.may_clear().map_err(Refusal::TooOften)?;
        self.modules.clear();
        if latched {
            give(Command::Clear, "", drive)?;
            self.stage.cleared(&status);
        }
        Ok(Reply::Done)
    }

    /// Passes if no values are staged.
    ///
    /// # Errors
    /// Values are staged.
    pub fn nothing_staged(&self) -> Result<(), Refusal> {
        if self.settings.is_staged() { Err(Refusal::Staged) } else { Ok(()) }
    }

    /// Passes if the received lines belong to this board.
    ///
    /// # Errors
    /// The lines belong to another board.
    fn is_own_board(&self) -> Result<(), Refusal> {
        let own = self.settings.in_force().board;
        match self.backup_of {
            Some(board) if board != Some(own) => {
                let theirs = board.map(|board| board.name);
                Err(Refusal::WrongBoard { theirs, own: own.name })
            }
            _ => Ok(()),
        }
    }

    /// Notes that a line of the console was refused. If it belongs to a backup, nothing starts until the user has decided about the rest.
    pub fn leave_out(&mut self) {
        self.left_out = self.left_out.saturating_add(self.backup_of.is_some().into());
    }

    /// Ends the backup that the console receives, because `order` is about to put its lines in force.
    ///
    /// # Errors
    /// The lines belong to another board, some of them were refused, or they may not be all: the last line of a backup applies them.
    fn end_backup(&mut self, order: &Order) -> Result<(), Refusal> {
        self.is_own_board()?;
        match (self.left_out, order) {
            (_, Order::ApplyRest) | (0, Order::Apply) => {}
            (0, _) if self.backup_of.is_none() => {}
            (0, _) => self.nothing_staged()?,
            (lines, _) => return Err(Refusal::LeftOut(lines)),
        }
        (self.backup_of, self.left_out) = (None, 0);
        Ok(())
    }

    /// Passes if the settings in the flash were not saved on another board.
    ///
    /// # Errors
    /// The settings were saved on another board.
    fn is_own_record(&self) -> Result<(), Refusal> {
        let own = self.settings.in_force().board.name;
        self.saved_on.map_or(Ok(()), |theirs| Err(Refusal::SavedOn { theirs, own }))
    }

    /// Stages settings.
    ///
    /// # Errors
    /// Nothing has changed: the drive is not off, or a value is out of its range.
    pub fn set(
        &mut self,
        from: Commander,
        values: &Assignments,
        drive: &impl DriveHandle,
    ) -> Answer {
        may_stage(drive)?;
        let late = values.iter().find(|(key, _)| key.change() == Change::FromReset);
        let confirmed = self.settings.latest().board_is_confirmed();
        if self.settings.set(from, values)? {
            return Ok(Reply::RestoredDropped);
        }
        Ok(match late {
            Some((key, _)) if self.settings.is_staged() => Reply::StagedForReset(*key),
            _ if confirmed && !self.settings.latest().board_is_confirmed() => Reply::Unconfirmed,
            _ => self.staged(),
        })
    }

    /// Stages a learned result with the staged settings.
    ///
    /// # Errors
    /// The drive is not off.
    pub fn restore(&mut self, learned: Learned, drive: &impl DriveHandle) -> Answer {
        may_stage(drive)?;
        self.settings.restore(learned);
        Ok(self.staged())
    }

    fn staged(&self) -> Reply {
        if self.settings.is_staged() { Reply::Staged } else { Reply::AsInForce }
    }

    /// Carries out a request that needs the staged settings in force; later if controllers are designed, which takes more than a moment.
    fn design(&mut self, from: Commander, order: Order, drive: &mut impl DriveHandle) -> Answer {
        match order {
            // The drive itself gives the reason why it does not start.
            Order::Start(mode) if !drive.is_off() => return self.start(mode, drive),
            Order::Learn { .. } if !drive.is_off() => return self.start(Mode::Learning, drive),
            _ => must_be_off(drive)?,
        }
        self.end_backup(&order)?;
        if order.is_for_the_commander(Commander::Console) {
            self.is_own_record()?;
            if !self.settings.latest().board_is_confirmed() {
                return Err(Refusal::NotConfirmed);
            }
            // A setting that was put back has made the board a confirmed one again.
            drive.connect();
        }
        let learned = self.settings.in_force().learned.is_some();
        let forgets = matches!(order, Order::Learn { again: false }) && learned;
        if self.settings.needs_design() || forgets {
            drive.status().ok_or_else(|| drive.no_control())?;
            self.wait(Task { from, order, applied: None });
            return Ok(Reply::Designing);
        }
        let staged = self.settings.prepare().is_some();
        self.unsaved |= staged;
        let applied = if staged { self.adopt(drive) } else { Applied::default() };
        self.complete(&order, applied, drive).1
    }

    /// Carries out the waiting task, if there is one, once its answer has been sent. Takes seconds. `now_ms` wraps.
    #[inline(never)] // its stack does not add to that of the interfaces
    pub fn run_pending(&mut self, drive: &mut impl DriveHandle, now_ms: u32) {
        let task = self.task.take();
        let waits = core::mem::take(&mut self.waits) == WAITS;
        let Some(Task { from, order, applied }) = task.filter(|_| waits) else { return };
        if matches!(order, Order::Reboot(_) | Order::Update) {
            let since = *self.reboot_ms.get_or_insert(now_ms);
            if now_ms.wrapping_sub(since) >= REBOOT_MS {
                return drive.reboot(order == Order::Update);
            }
            return self.wait(Task { from, order, applied });
        }
        // The time that the task takes does not count as silence of the user.
        self.last_activity_ms = None;
        let done = match applied {
            Some(applied) => self.complete(&order, applied, drive),
            None => match self.apply(&order, drive) {
                // The start follows in the next pass, so that a stop received meanwhile and an opened ENABLE are seen first.
                Ok(applied) if order.starts() => {
                    return self.wait(Task { from, order, applied: Some(applied) });
                }
                Ok(applied) => self.complete(&order, applied, drive),
                Err(why) => (Applied::default(), Err(why)),
            },
        };
        self.close(from, done);
    }

    /// Lets a task wait.
    fn wait(&mut self, task: Task) {
        (self.task, self.waits) = (Some(task), WAITS);
    }

    /// Drops a start that waits for its controllers, because a stop has come.
    fn cancel_start(&mut self, from: Commander) {
        if let Some(task) = self.task.take_if(|task| task.order.starts()) {
            let applied = task.applied.unwrap_or_default();
            if task.from != from {
                self.close(task.from, (applied, Err(Refusal::Stopped)));
            }
        }
    }

    /// Notes the result of a task.
    fn close(&mut self, from: Commander, done: Done) {
        match (from, done) {
            (Commander::Console, done) => self.done = Some(done),
            (from, (_, Err(why))) => self.note_refusal(from, why),
            _ => {}
        }
    }

    /// Completes a request whose settings are in force. The answer to [`Order::Apply`] takes these remarks.
    fn complete(&mut self, order: &Order, applied: Applied, drive: &mut impl DriveHandle) -> Done {
        let answer = match *order {
            Order::Apply | Order::ApplyRest => {
                return (Applied::default(), Ok(Reply::Applied(applied)));
            }
            Order::Start(mode) => self.start(mode, drive),
            Order::Learn { again: true } if self.settings.in_force().learned.is_none() => {
                Err(Refusal::NothingLearned)
            }
            Order::Learn { again } => {
                // If the learned values must not act, the drive has been given the settings without them.
                let begun = self.settings.begin_learning(again, |_| Ok(()));
                begun.and_then(|()| self.start(Mode::Learning, drive))
            }
            Order::Commission(first, last) => self.commission(first, last, drive),
            _ => self.save(Reply::Done, drive),
        };
        (applied, answer)
    }

    /// Saves the settings in force.
    fn save(&mut self, reply: Reply, drive: &mut impl DriveHandle) -> Answer {
        drive.save(self.settings.in_force())?;
        self.unsaved = false;
        Ok(reply)
    }

    /// Designs for the staged settings and puts them in force; for a self-commissioning, gives the drive those without the learned
    /// values. If they are refused, the drive keeps its settings and the new ones stay staged.
    fn apply(&mut self, order: &Order, drive: &mut impl DriveHandle) -> Result<Applied, Refusal> {
        self.designs = self.designs.wrapping_add(1);
        let mut applied = Applied::default();
        if self.settings.needs_design()
            && let Some(settings) = self.settings.prepare()
        {
            configure(drive, settings)?;
            (applied, self.unsaved) = (self.adopt(drive), true);
            drive.configured(self.settings.in_force());
        }
        if matches!(order, Order::Learn { again: false }) {
            self.settings.begin_learning(false, |settings| configure(drive, settings))?;
        }
        Ok(applied)
    }

    /// Takes the prepared settings as those in force, and notes which protective settings have changed.
    fn adopt(&mut self, drive: &mut impl DriveHandle) -> Applied {
        let staging = &self.settings;
        guarded().filter(|key| staging.differs(*key)).for_each(|key| drive.changed(key));
        self.settings.adopt()
    }

    /// Starts the drive; the first start since the defaults were set checks the wiring. With V/f control the boost serves as a check at
    /// every start.
    fn start(&mut self, mode: Mode, drive: &mut impl DriveHandle) -> Answer {
        self.not_held()?;
        // A start that turns a stop round: brake and wiring were taken care of.
        if !drive.is_off() {
            return give(Command::Start(mode), "", drive);
        }
        let brake_s = ModuleState::brake_s(self.settings.in_force());
        if brake_s.is_some() || self.braked {
            drive.command(Command::Brake(brake_s.unwrap_or(0.0)))?;
            self.braked = brake_s.is_some();
        }
        if self.settings.in_force().command.wiring_checked || mode == Mode::VoltsPerHertz {
            return give(Command::Start(mode), "", drive);
        }
        let began = drive.status().map(|status| status.periods);
        drive.command(Command::CheckWiring)?;
        drive.command(Command::Start(mode))?;
        self.checking = began;
        Ok(Reply::WiringFirst)
    }

    /// Passes if all modules let the drive run.
    fn not_held(&self) -> Result<(), Refusal> {
        let hold = self.modules.hold(self.settings.in_force());
        hold.map_or(Ok(()), |why| Err(Refusal::Held(why)))
    }

    /// Lets the drive measure its motor.
    fn commission(&mut self, first: Step, last: Step, drive: &mut impl DriveHandle) -> Answer {
        self.not_held()?;
        let status = drive.status().ok_or_else(|| drive.no_control())?;
        if let State::Fault(fault) = status.state {
            return Err(CommandError::Refused(Refused::Fault(fault)).into());
        }
        drive.session().begin(first, last);
        Ok(if last < Step::Inertia { Reply::Done } else { Reply::ShaftTurns })
    }

    /// Puts the results of the commissioning in force, and saves them.
    fn accept(&mut self, from: Commander, drive: &mut impl DriveHandle) -> Answer {
        may_stage(drive)?;
        self.end_backup(&Order::Accept)?;
        let found = drive.session().found(&self.settings.latest().drive);
        self.settings.stage(found.ok_or(Refusal::NothingFound)?);
        self.design(from, Order::Save, drive)
    }

    fn reboot(
        &mut self,
        from: Commander,
        order: Order,
        now: bool,
        drive: &impl DriveHandle,
    ) -> Result<(), Refusal> {
        must_be_off(drive)?;
        if !now && (self.unsaved || self.settings.is_staged()) {
            return Err(Refusal::Unsaved);
        }
        self.reboot_ms = None;
        self.wait(Task { from, order, applied: None });
        Ok(())
    }
}

/// Gives the drive a command; `unit` is the unit of its set-point.
fn give(command: Command, unit: &'static str, drive: &mut impl DriveHandle) -> Answer {
    Ok(match drive.command(command)? {
        Accepted::AsGiven => Reply::Done,
        Accepted::Limited(value) => Reply::Limited(value, unit),
    })
}

fn must_be_off(drive: &impl DriveHandle) -> Result<(), Refusal> {
    if drive.is_off() { Ok(()) } else { Err(Refusal::MustBeOff) }
}

/// Whether settings can be staged now.
///
/// # Errors
/// The reason why not.
pub fn may_stage(drive: &impl DriveHandle) -> Result<(), Refusal> {
    drive.status().ok_or_else(|| drive.no_control())?;
    must_be_off(drive)
}

/// Designs the controllers for settings, and gives them to the drive. This function is the only place that does, because the coefficients
/// take much stack.
#[inline(never)]
fn configure(drive: &mut impl DriveHandle, settings: &mut FirmwareSettings) -> Result<(), Refusal> {
    let coefficients = drive.build(settings).map_err(Refusal::Design)?;
    drive.command(Command::Configure(coefficients))?;
    Ok(())
}
