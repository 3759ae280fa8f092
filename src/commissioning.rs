//! Commissioning on the target: [`Commissioning`] in the main loop, fed by the control interrupt period by period.

use drive_commission::{Collector, Commissioning, Next, Record, Refusal, Report, Step};
use drive_core::{Command, Mode, Refused, Stop, TestReport};
use drive_settings::Settings;

use crate::recording::ring::Record as Period;
use crate::rotor_tracking::Tracking;

/// Event of a commissioning.
// Exists once at a time.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum News {
    /// A step has ended.
    Report(Report),
    /// All steps have ended, or one was refused; the outputs are off.
    Ended {
        /// Whether none was refused.
        sound: bool,
        /// The last step that was done.
        step: Step,
    },
}

/// A commissioning, and what it waits for.
#[derive(Clone, Debug)]
pub struct Session {
    commissioning: Commissioning,
    sums: Collector,
    /// Number of the next period, if there is no gap.
    next: u32,
    /// Event that the console has not taken yet; until it has, nothing goes on.
    news: Option<News>,
    /// [`ORDERED`] from the request to the end. It is a second condition beside the state of the commissioning, so that a flipped bit in
    /// that state energises no motor.
    ordered: u32,
}

/// See [`Session::ordered`].
const ORDERED: u32 = 0x695a_3cc3;

impl Session {
    /// A session for a drive with these settings, without results.
    pub fn new(settings: &Settings) -> Self {
        Self {
            commissioning: Commissioning::new(settings),
            sums: Collector::default(),
            next: 0,
            news: None,
            ordered: 0,
        }
    }

    /// Discards the results so far: the drive has taken these settings.
    #[inline(never)]
    pub fn configured(&mut self, settings: &Settings) {
        self.commissioning = Commissioning::new(settings);
        self.ordered = 0;
    }

    /// Begins the steps from `first` to `last`. The drive must be off.
    pub fn begin(&mut self, first: Step, last: Step) {
        self.news = None;
        self.sums.begin(Record::Nothing);
        self.commissioning.start(first, last);
        self.ordered = ORDERED;
    }

    /// Whether steps are being done.
    pub fn is_running(&self) -> bool {
        self.ordered == ORDERED && self.commissioning.is_running()
    }

    /// Takes the next [observed](Period::observed) period.
    pub fn take(&mut self, seen: &Period) {
        if seen.period != self.next {
            self.sums.gap();
        }
        self.next = seen.period.wrapping_add(1);
        let signals = &seen.telemetry;
        self.sums.push(signals.measured, signals.realised, signals.dc_link);
        self.sums.push_motion(signals.reference.q, signals.rotor_freq);
    }

    /// Advances the commissioning and returns a command for the drive, if there is one. If the drive does not take it, call
    /// [`refused`](Self::refused). `design` designs the current loop, which takes long, with the outputs off.
    pub fn poll(
        &mut self,
        drive: &TestReport,
        design: impl FnOnce(&mut Commissioning),
    ) -> Option<Command> {
        if !self.is_running() || self.news.is_some() {
            return None;
        }
        match self.commissioning.poll(drive, &mut self.sums) {
            Next::Wait => {}
            Next::Excite(excitation) => return Some(Command::Test(excitation)),
            Next::Stop => return Some(Command::Stop(Stop::Coast)),
            Next::Start => return Some(Command::Start(Mode::Torque)),
            Next::Torque(i_q) => return Some(Command::Torque(i_q)),
            Next::Design => design(&mut self.commissioning),
            Next::Report(report) => self.news = Some(News::Report(report)),
            Next::Done => {
                self.ordered = 0;
                let (sound, step) = (self.commissioning.is_sound(), self.commissioning.step());
                self.news = Some(News::Ended { sound, step });
            }
        }
        None
    }

    /// Notes that the drive has not taken a command; `None`: it does not answer.
    pub fn refused(&mut self, why: Option<Refused>) {
        let refusal = why.map_or(Refusal::SamplesLost, Refusal::Command);
        self.news = Some(News::Report(self.commissioning.refuse(refusal)));
    }

    /// The event since the last call.
    pub fn news(&mut self) -> Option<News> {
        self.news.take()
    }

    /// These settings with the results so far; `None` if they change nothing.
    pub fn found(&self, settings: &Settings) -> Option<Settings> {
        let found = self.commissioning.settings(settings);
        (found != *settings).then_some(found)
    }
}

/// Gives a period, if it is [observed](Period::observed), to the commissioning while it runs, and to the tracking otherwise. Returns the
/// rotor time constant, s, that the tracking has found.
pub fn observe(
    session: &mut Session,
    tracking: &mut Option<Tracking>,
    seen: &Period,
) -> Option<f32> {
    if seen.observed && session.is_running() {
        session.take(seen);
        return None;
    }
    tracking.as_mut().filter(|_| seen.observed)?.take(seen)
}

#[cfg(test)]
mod tests;
