//! The drive on a simulated motor, as the main loop of the firmware sees it: the counterpart of its supervisor and its control
//! interrupt.

use std::collections::VecDeque;
use std::fmt::{self, Write};

use drive_commission::Commissioning;
use drive_core::learned::Learned;
use drive_core::{
    Accepted, Coefficients, Command, Compare, Drive, FrontEndState, Hardware, Sample, State,
};
use drive_settings::SettingsError;
use induction_drive::board::TRACE_RECORDS;
use induction_drive::commissioning::{self, Session};
use induction_drive::console::handle::Firmware;
use induction_drive::desk::handle::{CommandError, DriveHandle};
use induction_drive::history::History;
use induction_drive::link::Status;
use induction_drive::recording::ring::Record;
use induction_drive::recording::trace::{self, Plan, Recorder, Sampled, Trace};
use induction_drive::rotor_tracking::{Report, Tracking};
use induction_drive::settings::FirmwareSettings;
use induction_drive::store::FlashError;
use motor_plant::Plant;

/// The drive and its motor, see the head of the module.
pub struct Machine {
    /// The motor and its surroundings.
    pub plant: Plant,
    drive: Drive,
    front_end: FrontEndState,
    sample: Sample,
    periods: u32,
    /// Periods from one record of the stream to the next, 0 for none; records that were not fetched.
    streamed: (u32, VecDeque<Record>),
    trace: (Recorder<'static, TRACE_RECORDS>, trace::Reader<'static, TRACE_RECORDS>),
    session: Session,
    tracking: Option<Tracking>,
    /// The result of a self-commissioning that was not fetched.
    found: Option<Learned>,
    history: History,
    /// Settings after a reset.
    pub saved: FirmwareSettings,
    /// Whether a reset was requested.
    pub resets: bool,
    /// FNV-1a over the compare values and the currents of all periods.
    pub fingerprint: u64,
}

impl Machine {
    /// The drive with these settings, off. The memory of a trace stays allocated until the program ends.
    ///
    /// # Errors
    /// No drive can be built with the settings.
    pub fn new(plant: Plant, settings: &FirmwareSettings) -> Result<Self, SettingsError> {
        let drive = Drive::new(settings.build()?);
        let memory: &Trace<TRACE_RECORDS> = Box::leak(Box::new(Trace::new()));
        let Some(trace) = memory.take() else { unreachable!("it is new") };
        Ok(Self {
            plant,
            drive,
            front_end: FrontEndState::default(),
            sample: Sample::default(),
            periods: 0,
            streamed: (0, VecDeque::new()),
            trace,
            session: Session::new(&settings.drive),
            tracking: Tracking::new(&settings.drive),
            found: None,
            history: History::default(),
            saved: *settings,
            resets: false,
            fingerprint: 0xcbf2_9ce4_8422_2325,
        })
    }

    /// The drive.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Flux angle of the drive, that of the motor, turns, and flux of the motor, Wb.
    pub fn flux(&self) -> [f64; 3] {
        let turns = self.plant.rotor_flux_angle() / std::f64::consts::TAU;
        let own = self.drive.telemetry().phi.to_turns();
        [own.into(), turns.rem_euclid(1.0), self.plant.rotor_flux().norm()]
    }

    /// Simulates one control period, with all tasks of its interrupt.
    pub fn period(&mut self) {
        self.sample = self.plant.sample();
        let before = self.drive.state();
        let (compare, output) = self.drive.period(&mut self.front_end, &self.sample, &mut |_| {});
        self.plant.period(&compare, &output);
        self.periods = self.periods.wrapping_add(1);
        let (current, Compare { a, b, c, .. }) = (self.plant.current(), compare);
        let duties = u64::from(a) | u64::from(b) << 16 | u64::from(c) << 32;
        for word in [duties, current.re.to_bits(), current.im.to_bits()] {
            self.fingerprint = (self.fingerprint ^ word).wrapping_mul(0x0100_0000_01b3);
        }

        let state = self.drive.state();
        if before == State::Learning && state != before {
            self.found = self.drive.learned().copied();
        }
        let sampled = Sampled::new(&self.sample, state, self.drive.limiting());
        self.trace.0.step(&sampled, self.drive.telemetry());
        let streamed = self.periods.checked_rem(self.streamed.0) == Some(0);
        let (drive, commissions) = (&self.drive, self.session.is_running());
        let observed =
            drive.tracks_rotor() || drive.is_testing() || commissions && state.regulates();
        if streamed || observed {
            let (period, telemetry) = (self.periods, *self.drive.telemetry());
            let record = Record { period, telemetry, sampled, observed, streamed };
            if streamed {
                self.streamed.1.push_back(record);
            }
            self.observe(&record);
        }
        if commissions
            && let Some(next) = self.session.poll(&self.drive.test_report(), Commissioning::design)
            && let Err(why) = self.drive.command(&next)
        {
            self.session.refused(Some(why));
        }
    }

    fn observe(&mut self, record: &Record) {
        let tau_r = commissioning::observe(&mut self.session, &mut self.tracking, record);
        // The drive refuses the command if it has just stopped.
        if let (Some(tau_r), Some(tracking)) = (tau_r, &mut self.tracking)
            && let Ok(accepted) = self.drive.command(&Command::RotorTimeConstant(tau_r))
        {
            tracking.taken(tau_r, accepted);
        }
    }
}

impl DriveHandle for Machine {
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError> {
        self.drive.command(&command).map_err(CommandError::Refused)
    }
    fn status(&self) -> Option<Status> {
        Some(Status {
            periods: self.periods,
            state: self.drive.state(),
            sample: self.sample,
            telemetry: *self.drive.telemetry(),
            hardware: Hardware::empty(),
            learning: self.drive.learning_progress(),
            limiting: self.drive.limiting(),
            torque_limits: self.drive.torque_limits(),
            stator_resistance: self.drive.stator_resistance(),
            test_report: self.drive.test_report(),
            ..Status::default()
        })
    }
    fn is_off(&self) -> bool {
        self.drive.is_off()
    }
    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError> {
        settings.build()
    }
    fn configured(&mut self, settings: &FirmwareSettings) {
        self.tracking = Tracking::new(&settings.drive);
        self.session.configured(&settings.drive);
    }
    fn session(&mut self) -> &mut Session {
        &mut self.session
    }
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError> {
        self.saved = *settings;
        Ok(())
    }
    fn reboot(&mut self, _: bool) {
        self.resets = true;
    }
    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        self.found.take().iter().for_each(show);
    }
}

impl Firmware for Machine {
    fn tracking(&self) -> Option<Report> {
        self.tracking.as_ref().map(Tracking::report)
    }
    fn history(&self) -> &History {
        &self.history
    }
    fn begin_trace(&mut self, plan: &Plan) -> bool {
        self.trace.1.begin(plan)
    }
    fn cancel_trace(&mut self) {
        self.trace.1.cancel();
    }
    fn tracing(&self) -> bool {
        self.trace.1.recording()
    }
    fn traced(&self, i: u16) -> Option<(i16, trace::Record)> {
        self.trace.1.get(i)
    }
    fn stream(&mut self, divider: u16) {
        self.streamed = (divider.into(), VecDeque::new());
    }
    fn sampled(&mut self) -> Option<Record> {
        self.streamed.1.pop_front()
    }
    fn stack(&self) -> (usize, usize) {
        (0, 0)
    }
    fn version(&self, to: &mut dyn Write) -> fmt::Result {
        to.write_str(concat!(env!("CARGO_PKG_VERSION"), ", simulated motor"))
    }
    fn last_run(&self, to: &mut dyn Write) -> fmt::Result {
        to.write_str("simulated")
    }
}
