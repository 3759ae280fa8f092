//! The main loop's side of the drive: commands of the console, tracking, log, and watchdog.

use core::fmt;
use core::mem::MaybeUninit;
use core::sync::atomic::Ordering;

use drive_core::learned::Learned;
use drive_core::{Accepted, Coefficients, Command};
use drive_settings::{Settings, SettingsError};

use crate::task::check::Check;
use crate::task::clock::Clock;
use crate::task::control;
use crate::task::sources::Sources;
use induction_drive::board;
use induction_drive::chip::flash::Pages;
use induction_drive::chip::watchdog::{Guard, extended};
use induction_drive::chip::{memory, over_voltage, pwm, start, stop, time};
use induction_drive::commissioning::{self, Session};
use induction_drive::console::handle::Firmware;
use induction_drive::console::words;
use induction_drive::desk::handle::{CommandError, DriveHandle};
use induction_drive::history::{History, Hours};
use induction_drive::link::mailbox::{Receiver, Sender};
use induction_drive::link::{Answer, Status};
use induction_drive::log::{Level, Log};
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::recording::ring::{self, Record as Period};
use induction_drive::recording::trace::{self, Plan};
use induction_drive::rotor_tracking::{Report, Tracking};
use induction_drive::settings::FirmwareSettings;
use induction_drive::settings::keys::Key;
use induction_drive::store::codec::Rejected;
use induction_drive::store::{FlashError, Saved};

/// Version and commit of the firmware.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), ", commit ", env!("GIT_HASH"));

/// Signals of the control interrupt.
pub type Signals = ring::Reader<'static, { ring::PERIODS }>;

/// The main loop's ends of the communication with the control interrupt.
pub struct ControlLink {
    /// Reports of the interrupt.
    pub status: Receiver<'static, Status>,
    /// Commands to the drive.
    pub commands: Sender<'static, Command>,
    /// Answers of the drive.
    pub answers: Receiver<'static, Answer>,
    /// Results of a self-commissioning.
    pub learned: Receiver<'static, Option<Learned>>,
    /// The trace.
    pub trace: trace::Reader<'static, { board::TRACE_RECORDS }>,
    /// Signals for the stream.
    pub streamed: Signals,
    /// Signals for the identification of the rotor time constant, and for the commissioning.
    pub observed: Signals,
    /// Signals for the report.
    pub reported: Signals,
    /// The cross-checks of clock and reference voltage.
    pub sources: Sources,
}

/// The main loop's side of the drive.
pub struct Supervisor {
    /// `None` if the control does not run.
    link: Option<ControlLink>,
    status: Option<Status>,
    log: Log,
    clock: Clock,
    guard: Guard,
    /// Check of memory and registers; `None` if the control does not run.
    check: Option<Check>,
    /// Whether the firmware has run long enough to clear the count of earlier resets.
    well: bool,
    chip: Chip,
    /// Tracking of the rotor time constant, if the settings enable it.
    tracking: Option<Tracking>,
    /// The commissioning. (Large, so not on the stack.)
    commissioning: &'static mut Session,
    hours: Hours,
}

/// State of the chip at start, and the saved settings.
pub struct Chip {
    /// Cause of the reset.
    pub cause: &'static str,
    /// End of the last run.
    pub record: Option<Record>,
    /// Option bytes.
    pub options: u32,
    /// Whether the flash has two banks.
    pub dual_bank: bool,
    /// The saved settings.
    pub saved: Saved<Pages>,
    /// Reason why the saved settings were rejected, if they were.
    pub rejected: Option<Rejected>,
    /// Values with which the timer of the power stage was set up.
    pub timer: board::Timer,
    /// Reason why the control was not started, if it was not.
    pub not_started: Option<&'static str>,
    /// Whether the pins of the gates are connected.
    pub connected: bool,
}

impl Supervisor {
    /// A supervisor, made in its place; without `link`, one whose control does not run.
    #[inline(never)]
    pub fn new<'a>(
        place: &'a mut MaybeUninit<Self>,
        link: Option<ControlLink>,
        guard: Guard,
        chip: Chip,
        hours: Hours,
        commissioning: &'static mut Session,
        settings: &Settings,
    ) -> &'a mut Self {
        let check = link.as_ref().and_then(|_| Check::new());
        place.write(Self {
            link,
            status: None,
            log: Log::new(settings),
            clock: Clock::new(),
            guard,
            check,
            well: false,
            hours,
            chip,
            tracking: Tracking::new(settings),
            commissioning,
        })
    }

    /// Receives the reports of the control, logs them, and tracks the rotor time constant. Returns the time
    /// since the start, ms, wrapping.
    #[inline(never)]
    pub fn listen(&mut self) -> u32 {
        self.track();
        if let Some(link) = &mut self.link
            && let Some(status) = link.status.take()
        {
            let newest = link.reported.by_ref().last().unwrap_or_default();
            self.report(Status { telemetry: newest.telemetry, ..status });
        }
        self.commission();
        // The commissioning designs for seconds, and the console needs the time after that.
        self.clock.update();
        let now = self.clock.ms;
        let dc_link = (!self.is_off()).then_some(control::addresses::DC_LINK as u32);
        self.hours.count(now, dc_link, &mut self.guard, self.chip.saved.flash());
        self.link.iter_mut().for_each(|link| link.sources.watch(now));
        self.clock.ms
    }

    /// Checks a slice of the control's memory and of its registers, and feeds the watchdog if the rule allows it. Called at the end of
    /// each pass of the main loop, and after long operations in it.
    pub fn feed_watchdog(&mut self) {
        self.check.iter_mut().for_each(Check::slice);
        let Some(watchdog) = &mut self.guard else { return };
        watchdog.feed(control::MISSED.load(Ordering::Relaxed));
        if self.clock.ms > board::WELL_AFTER_MS && !self.well {
            self.well = true;
            stop::forget_resets();
        }
    }

    /// Feeds the tracking with the periods received. Terminates: handling one period takes less than one period.
    #[inline(never)] // a command takes much stack
    fn track(&mut self) {
        while let Some(link) = &mut self.link {
            // Handled in place: copying each period would take most of the time.
            let tau_r = link.observed.take_with(|period| {
                commissioning::observe(self.commissioning, &mut self.tracking, period)
            });
            let Some(tau_r) = tau_r else { return };
            let Some(tau_r) = tau_r else { continue };
            // The drive refuses the command if it has just stopped.
            let answer = self.command(Command::RotorTimeConstant(tau_r));
            if let (Ok(accepted), Some(tracking)) = (answer, self.tracking.as_mut()) {
                tracking.taken(tau_r, accepted);
            }
        }
    }

    /// Continues the commissioning.
    #[inline(never)] // a command takes much stack
    fn commission(&mut self) {
        let Some(Status { test_report, .. }) = self.status else { return };
        control::RECORD_FOR_MAIN.store(self.commissioning.is_running(), Ordering::Relaxed);
        // A search takes most of the time of the watchdog, and so may the console before it, with the periods received meanwhile. The
        // drive answers a command within a period.
        self.feed_watchdog();
        let command = self.commissioning.poll(&test_report, |commissioning| {
            extended(&mut self.guard, || commissioning.design());
        });
        self.feed_watchdog();
        if let Some(Err(why)) = command.map(|command| self.command(command)) {
            let why = if let CommandError::Refused(why) = why { Some(why) } else { None };
            self.commissioning.refused(why);
        }
    }

    /// Takes a report of the control: logs it, and keeps faults for the next boot and in the history.
    fn report(&mut self, mut s: Status) {
        s.worst_latency = s.worst_latency.saturating_sub(self.chip.timer.below_the_top());
        let before = self.status.replace(s);
        let is_new = before.map(|status| status.state) != Some(s.state);
        if let Some(fault) = s.state.fault().filter(|_| is_new) {
            stop::keep(Reason::Drive, [u32::from(fault.code()), 0, 0, 0]);
        }
        self.log.report(before.as_ref(), &s);
        if is_new {
            // Called last, because it writes to the flash for milliseconds.
            self.hours.entered(s.state, &mut self.guard, self.chip.saved.flash());
        }
    }
}

impl DriveHandle for Supervisor {
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError> {
        let not_started = self.no_control();
        let dc_link = self.status.map_or(0, |status| status.sample.dc_link);
        let starts = matches!(command, Command::Start(_) | Command::Test(_)) && self.is_off();
        let link = self.link.as_mut().ok_or(not_started)?;
        if starts && !over_voltage::prove(dc_link) {
            return Err(CommandError::NotStarted(over_voltage::UNPROVED));
        }
        // Discards an answer that came too late for its command.
        link.answers.take();
        if !link.commands.send(command) {
            return Err(CommandError::NoAnswer);
        }
        let began = time::now();
        while time::now().wrapping_sub(began) < board::ANSWER_TIMEOUT_US * board::CYCLES_PER_US {
            if let Some(answer) = link.answers.take() {
                return answer.map_err(CommandError::Refused);
            }
        }
        Err(CommandError::NoAnswer)
    }

    fn no_control(&self) -> CommandError {
        self.chip.not_started.map_or(CommandError::NoAnswer, CommandError::NotStarted)
    }

    fn status(&self) -> Option<Status> {
        self.status
    }

    fn is_off(&self) -> bool {
        control::STAGE.load(Ordering::Relaxed) == control::OFF
    }

    fn is_stopping(&self) -> bool {
        control::STAGE.load(Ordering::Relaxed) == control::STOPPING
    }

    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError> {
        extended(&mut self.guard, || settings.build_for(&self.chip.timer))
    }

    fn configured(&mut self, settings: &FirmwareSettings) {
        self.tracking = Tracking::new(&settings.drive);
        self.commissioning.configured(&settings.drive);
        self.log.configured(&settings.drive);
    }

    fn connect(&mut self) {
        if self.link.is_some() && !self.chip.connected {
            self.chip.connected = true;
            pwm::connect_gates();
            self.check.iter_mut().for_each(Check::renew);
        }
    }

    fn changed(&mut self, key: Key) {
        self.hours.changed(key.id(), &mut self.guard, self.chip.saved.flash());
    }

    fn session(&mut self) -> &mut Session {
        self.commissioning
    }

    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError> {
        extended(&mut self.guard, || self.chip.saved.save(settings))?;
        self.chip.rejected = None;
        Ok(())
    }

    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        if let Some(link) = &mut self.link {
            link.learned.take_with(|result| result.as_ref().map(show));
        }
    }

    fn reboot(&mut self, loader: bool) {
        pwm::outputs_off();
        if loader {
            start::into_loader();
        }
        cortex_m::peripheral::SCB::sys_reset();
    }
}

impl Firmware for Supervisor {
    fn tracking(&self) -> Option<Report> {
        self.tracking.as_ref().map(Tracking::report)
    }

    fn history(&self) -> &History {
        &self.hours.history
    }

    fn begin_trace(&mut self, plan: &Plan) -> bool {
        self.link.as_mut().is_some_and(|link| link.trace.begin(plan))
    }

    fn cancel_trace(&mut self) {
        self.link.iter_mut().for_each(|link| link.trace.cancel());
    }

    fn tracing(&self) -> bool {
        self.link.as_ref().is_some_and(|link| link.trace.recording())
    }

    fn traced(&self, i: u16) -> Option<(i16, trace::Record)> {
        self.link.as_ref()?.trace.get(i)
    }

    fn stream(&mut self, divider: u16) {
        control::STREAM_DIVIDER.store(divider.into(), Ordering::Relaxed);
        self.link.iter_mut().for_each(|link| link.streamed.by_ref().for_each(drop));
    }

    fn sampled(&mut self) -> Option<Period> {
        self.link.as_mut()?.streamed.find(|period| period.streamed)
    }

    fn set_log_level(&mut self, level: Level) {
        self.log.level = level;
    }

    fn stack(&self) -> (usize, usize) {
        (memory::stack_used(), memory::stack_size())
    }

    fn version(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        to.write_str(VERSION)?;
        write!(to, ", image {:08x}, build ", start::check())?;
        memory::build_id().iter().try_for_each(|byte| write!(to, "{byte:02x}"))?;
        let banks = if self.chip.dual_bank { 2 } else { 1 };
        write!(to, "; option bytes {:08x}, {banks} bank(s)", self.chip.options)
    }

    fn last_run(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        let Chip { cause, record, not_started, rejected, .. } = &self.chip;
        words::last_run(to, cause, record.as_ref(), *not_started, rejected.as_ref())
    }
}
