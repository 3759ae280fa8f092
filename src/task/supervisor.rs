//! The main loop's side of the drive: what the console talks about, and the log.

use core::fmt;
use core::sync::atomic::Ordering;

use cortex_m::peripheral::DWT;
use defmt::Display2Format;
use drive_core::identify::learning::Learned;
use drive_core::settings::SettingsError;
use drive_core::{Accepted, Coefficients, Command, Hardware, State};

use crate::chip::flash::Pages;
use crate::chip::memory;
use crate::chip::{pwm, stop};
use crate::task::control;
use induction_drive::board;
use induction_drive::console::grammar::Level;
use induction_drive::console::keys::FirmwareSettings;
use induction_drive::console::{DriveHandle, NotDone};
use induction_drive::link::mailbox::{Receiver, Sender};
use induction_drive::link::ring;
use induction_drive::link::trace;
use induction_drive::link::{Answer, Status};
use induction_drive::monitor::memory_check::{Flipped, MemoryCheck, Places};
use induction_drive::monitor::record::{Reason, Record};
use induction_drive::monitor::watchdog::{Rule, Verdict, Watchdog};
use induction_drive::rotor_tracking::{Report, Seen, Tracking};
use induction_drive::store::{Failed, NotUsed, Saved};

/// Which firmware this is, in the sources.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), ", commit ", env!("GIT_HASH"));

/// The ends of what goes to the control interrupt and comes from it.
pub struct Ends {
    /// Reports.
    pub status: Receiver<'static, Status>,
    /// To the drive.
    pub orders: Sender<'static, Command>,
    /// From the drive.
    pub answers: Receiver<'static, Answer>,
    /// What a learning found.
    pub learned: Receiver<'static, Option<Learned>>,
    /// The trace.
    pub trace: trace::Reader<'static, { board::TRACE_RECORDS }>,
    /// What the identification sees.
    pub seen: ring::Reader<'static, Seen, { board::SEEN_PERIODS }>,
}

/// The main loop's side of the drive.
pub struct Supervisor {
    /// Nothing if the control does not run.
    ends: Option<Ends>,
    status: Option<Status>,
    level: Level,
    clock: Clock,
    guard: Option<(Watchdog, Rule)>,
    /// Over a control that runs.
    check: Option<MemoryCheck<5>>,
    /// Whether it has run for a while.
    well: bool,
    chip: Chip,
    /// The rotor time constant, where the settings want it tracked. (Not on the stack: it is large.)
    tracking: &'static mut Option<Tracking>,
}

/// What the supervisor knows of the chip and of its own start.
pub struct Chip {
    /// What reset it.
    pub cause: &'static str,
    /// What the firmware wrote before.
    pub record: Option<Record>,
    /// Its option bytes.
    pub options: u32,
    /// Whether its flash has two banks.
    pub dual_bank: bool,
    /// The pages of the settings.
    pub saved: Saved<Pages>,
    /// Why what was saved is not used, if it is not.
    pub not_used: Option<NotUsed>,
    /// Dead time that the timer makes, s.
    pub dead_time_s: f32,
}

/// Milliseconds, from the cycle counter, which wraps every 25 s: read it more often.
struct Clock {
    last: u32,
    cycles: u32,
    ms: u32,
}

impl Clock {
    fn update(&mut self) {
        let now = DWT::cycle_count();
        self.cycles += now.wrapping_sub(self.last);
        self.last = now;
        let per_ms = board::CYCLES_PER_US * 1000;
        self.ms = self.ms.wrapping_add(self.cycles / per_ms);
        self.cycles %= per_ms;
    }
}

impl Supervisor {
    /// A supervisor; without `ends`, one whose control does not run.
    pub fn new(
        ends: Option<Ends>,
        watchdog: Option<Watchdog>,
        chip: Chip,
        tracking: &'static mut Option<Tracking>,
    ) -> Self {
        let clock = Clock { last: DWT::cycle_count(), cycles: 0, ms: 0 };
        let periods = control::PERIODS.load(Ordering::Relaxed);
        let guard = watchdog.map(|watchdog| (watchdog, Rule::new(clock.last, periods)));
        let check = ends.is_some().then(|| {
            let ((code, source), (constants, changes)) =
                (memory::control_code(), control::constants());
            MemoryCheck::new(Places { code, source, constants, changes }, memory::word)
        });
        Self {
            ends,
            status: None,
            level: Level::Info,
            clock,
            guard,
            check,
            well: false,
            chip,
            tracking,
        }
    }

    /// Looks at a slice of the control's memory. What has flipped ends it: start-up copies and computes it
    /// afresh.
    pub fn check_memory(&mut self) {
        match self.check.as_mut().map(|check| check.slice(memory::word)) {
            Some(Err(Flipped::Code { address, found, copied })) => {
                stop::end(Reason::Code, [address, found, copied, 0]);
            }
            Some(Err(Flipped::Constants { found, before })) => {
                stop::end(Reason::Coefficients, [found, before, 0, 0]);
            }
            Some(Ok(())) | None => {}
        }
    }

    /// Takes what the control reports, logs it, and tracks the rotor time constant by it. Gives the time
    /// since the start, ms, wrapping.
    pub fn listen(&mut self) -> u32 {
        self.clock.update();
        self.track();
        if let Some(status) = self.ends.as_mut().and_then(|ends| ends.status.take()) {
            self.log(status);
        }
        self.clock.ms
    }

    /// Feeds the watchdog, if the rule allows. Last thing in a pass of the main loop.
    pub fn feed_watchdog(&mut self) {
        let Some((watchdog, rule)) = &mut self.guard else { return };
        let missed = control::MISSED.load(Ordering::Relaxed);
        let periods = control::PERIODS.load(Ordering::Relaxed);
        match rule.judge(DWT::cycle_count(), periods, missed) {
            Verdict::Wait => {}
            Verdict::Feed => watchdog.feed(),
            // The watchdog resets the chip in a moment. Until then nothing is wrong with the loop, and
            // what the console is asked for is still done.
            Verdict::Refuse { periods, cycles } => {
                pwm::outputs_off();
                stop::keep(Reason::NotFed, [periods, cycles, u32::from(missed), 0]);
            }
        }
        if self.clock.ms > board::WELL_AFTER_MS && !self.well {
            self.well = true;
            stop::forget_resets();
        }
    }

    /// Comes to an end: a period takes less time here than it lasts.
    fn track(&mut self) {
        while let Some(seen) = self.ends.as_mut().and_then(|ends| ends.seen.pop()) {
            let Some(tau_r) = self.tracking.as_mut().and_then(|t| t.take(&seen)) else { continue };
            // Refused when the drive has just stopped.
            let answer = self.order(Command::RotorTimeConstant(tau_r));
            if let (Ok(taken), Some(tracking)) = (answer, self.tracking.as_mut()) {
                tracking.taken(tau_r, taken);
            }
        }
    }

    fn log(&mut self, s: Status) {
        let before = self.status.replace(s).map(|status| status.state);
        if before != Some(s.state)
            && let State::Fault(fault) = s.state
        {
            stop::keep(Reason::Drive, [u32::from(fault.code()), 0, 0, 0]);
            if self.level >= Level::Error {
                defmt::error!("fault {}: {}", fault.code(), fault.meaning());
            }
        }
        if self.level >= Level::Warn {
            for (event, text) in [
                (Hardware::BREAK, "the power stage pulls the break input, or is not there"),
                (Hardware::ANALOG_WATCHDOG, "over-current at a converter"),
                (Hardware::DEADLINE_MISS, "a control period took too long"),
                (Hardware::CONVERTER_OVERRUN, "a conversion was lost"),
            ] {
                if s.hardware.intersects(event) {
                    defmt::warn!("{}", text);
                }
            }
        }
        if self.level >= Level::Info {
            defmt::info!(
                "{}: codes {} {}, dc link {}, heat sink {}, encoder {}; {} periods, {} cycles, late {}",
                Display2Format(&s.state),
                s.sample.current_a,
                s.sample.current_b,
                s.sample.dc_link,
                s.sample.heat_sink,
                s.sample.encoder,
                s.periods,
                s.worst_cycles,
                s.worst_latency,
            );
        }
    }
}

impl DriveHandle for Supervisor {
    fn order(&mut self, order: Command) -> Result<Accepted, NotDone> {
        let ends = self.ends.as_mut().ok_or(NotDone::NoAnswer)?;
        // An answer that came too late for its order.
        ends.answers.take();
        if !ends.orders.send(order) {
            return Err(NotDone::NoAnswer);
        }
        let began = DWT::cycle_count();
        while DWT::cycle_count().wrapping_sub(began)
            < board::ANSWER_TIMEOUT_US * board::CYCLES_PER_US
        {
            if let Some(answer) = ends.answers.take() {
                return answer.map_err(NotDone::Refused);
            }
        }
        Err(NotDone::NoAnswer)
    }

    fn status(&self) -> Option<Status> {
        self.status
    }

    fn is_off(&self) -> bool {
        control::IS_OFF.load(Ordering::Relaxed)
    }

    fn build(&mut self, settings: &FirmwareSettings) -> Result<Coefficients, SettingsError> {
        stretched(&mut self.guard, || settings.build_for(self.chip.dead_time_s))
    }

    fn configured(&mut self, settings: &FirmwareSettings) {
        *self.tracking = Tracking::new(&settings.drive);
    }

    fn tracking(&self) -> Option<Report> {
        self.tracking.as_ref().map(Tracking::report)
    }

    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), Failed> {
        stretched(&mut self.guard, || self.chip.saved.save(settings))?;
        self.chip.not_used = None;
        Ok(())
    }

    fn begin_trace(&mut self, records: u16, divider: u16, choice: &trace::Choice) -> bool {
        self.ends.as_mut().is_some_and(|ends| ends.trace.begin(records, divider, choice))
    }

    fn tracing(&self) -> bool {
        self.ends.as_ref().is_some_and(|ends| ends.trace.recording())
    }

    fn traced(&self, i: u16) -> Option<trace::Record> {
        self.ends.as_ref()?.trace.get(i)
    }

    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        if let Some(ends) = &mut self.ends {
            ends.learned.take_with(|found| found.as_ref().map(show));
        }
    }

    fn set_log_level(&mut self, level: Level) {
        self.level = level;
    }

    fn stack(&self) -> (usize, usize) {
        (memory::stack_used(), memory::stack_size())
    }

    fn version(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        to.write_str(VERSION)?;
        to.write_str(", build ")?;
        memory::build_id().iter().try_for_each(|byte| write!(to, "{byte:02x}"))?;
        let banks = if self.chip.dual_bank { 2 } else { 1 };
        write!(to, "; option bytes {:08x}, {banks} bank(s)", self.chip.options)
    }

    fn last_run(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "reset by {}", self.chip.cause)?;
        if let Some(record) = &self.chip.record {
            write!(to, ", {record}")?;
        }
        match &self.chip.not_used {
            Some(why) => write!(to, "; {why}"),
            None => Ok(()),
        }
    }
}

/// Does what takes long, with the time of the watchdog stretched, and lets it count from there: with
/// one bank of flash the core, and the control with it, waits while the flash is written.
fn stretched<R>(guard: &mut Option<(Watchdog, Rule)>, work: impl FnOnce() -> R) -> R {
    match guard {
        Some((watchdog, rule)) => {
            let result = watchdog.stretched(work);
            rule.restart(DWT::cycle_count(), control::PERIODS.load(Ordering::Relaxed));
            result
        }
        None => work(),
    }
}
