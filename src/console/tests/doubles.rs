//! Stand-ins for the drive and the serial port, for the tests of the console and for fuzzing.

use std::collections::VecDeque;
use std::fmt::{self, Write};

use drive_core::carrier::Asymmetry;
use drive_core::learned::{Fitted, Learned, Verdict};
use drive_core::table::{CarrierTable, Grid, ReferenceTable, SlopeTable};
use drive_core::{Accepted, Coefficients, Command, Drive, Hardware, Sample, State};
use drive_settings::{Settings, SettingsError};
use drive_stream::{Frame, Piece, Splitter};
use induction_drive::board;
use induction_drive::commissioning::Session;
use induction_drive::console::handle::{Firmware, Port};
use induction_drive::desk::handle::{CommandError, DriveHandle};
use induction_drive::history::History;
use induction_drive::link::Status;
use induction_drive::log::Level;
use induction_drive::modbus;
use induction_drive::modbus::settings::{Baud, Format, Settings as BusSettings};
use induction_drive::modbus::slave::Written;
use induction_drive::recording::ring::Record;
use induction_drive::recording::trace::{self, Plan, Trigger};
use induction_drive::rotor_tracking::{Report, Tracking};
use induction_drive::settings::FirmwareSettings;
use induction_drive::settings::keys::Key;
use induction_drive::store::FlashError;
use induction_drive::terminals::{self, Contacts};

/// A drive without hardware.
pub struct FakeDrive {
    /// The drive.
    pub drive: Drive,
    /// Whether its control runs.
    pub running: bool,
    /// Last sample.
    pub sample: Sample,
    /// The last requested trace, and whether its trigger has come.
    pub plan: Option<Plan>,
    /// See `plan`.
    pub triggered: bool,
    /// Times that the chip was reset, and whether into ST's loader.
    pub reboots: u32,
    /// See `reboots`.
    pub in_loader: bool,
    /// Commands so far.
    pub commands: Vec<Command>,
    /// Settings saved last.
    pub saved: Option<FirmwareSettings>,
    /// Whether the flash fails.
    pub worn_out: bool,
    /// Result of a self-commissioning, not yet fetched.
    pub found: Option<Learned>,
    /// Tracking of the rotor time constant.
    pub tracking: Option<Tracking>,
    /// Divider of the stream, and its samples that were not fetched.
    pub streamed: (u16, VecDeque<Record>),
    /// The commissioning.
    pub session: Session,
    /// Operating hours, starts and faults.
    pub history: History,
    /// Whether the pins of the gates are connected.
    pub connected: bool,
    /// Protective settings that were changed, in order.
    pub changed: Vec<&'static str>,
}

impl FakeDrive {
    /// A running drive.
    pub fn new(drive: Drive) -> Self {
        Self {
            drive,
            running: true,
            sample: Sample { heat_sink: 1309, ..Sample::default() },
            plan: None,
            triggered: false,
            reboots: 0,
            in_loader: false,
            commands: Vec::new(),
            saved: None,
            worn_out: false,
            found: None,
            tracking: None,
            streamed: (0, VecDeque::new()),
            session: Session::new(&Settings::default()),
            history: History::default(),
            connected: false,
            changed: Vec::new(),
        }
    }
}

impl DriveHandle for FakeDrive {
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError> {
        if !self.running {
            return Err(self.no_control());
        }
        self.commands.push(command);
        self.drive.command(&command).map_err(CommandError::Refused)
    }
    fn no_control(&self) -> CommandError {
        CommandError::NotStarted("a test")
    }
    fn status(&self) -> Option<Status> {
        self.running.then(|| Status {
            periods: self.commands.len() as u32,
            state: self.drive.state(),
            sample: self.sample,
            telemetry: *self.drive.telemetry(),
            worst_cycles: [u32::MAX; 2],
            last_cycles: 800,
            worst_latency: u32::MAX,
            hardware: Hardware::empty(),
            learning: self.drive.learning_progress(),
            limiting: self.drive.limiting(),
            torque_limits: self.drive.torque_limits(),
            stator_resistance: self.drive.stator_resistance(),
            test_report: self.drive.test_report(),
        })
    }
    fn is_off(&self) -> bool {
        matches!(self.drive.state(), State::Off | State::Fault(_))
    }
    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError> {
        settings.build()
    }
    fn configured(&mut self, settings: &FirmwareSettings) {
        self.tracking = Tracking::new(&settings.drive);
        self.session.configured(&settings.drive);
    }
    fn connect(&mut self) {
        self.connected = true;
    }
    fn changed(&mut self, key: Key) {
        self.changed.push(key.name());
    }
    fn session(&mut self) -> &mut Session {
        &mut self.session
    }
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError> {
        if self.worn_out {
            return Err(FlashError::Erase(0x10));
        }
        self.saved = Some(*settings);
        Ok(())
    }
    fn reboot(&mut self, loader: bool) {
        self.reboots += 1;
        self.in_loader = loader;
    }
    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        if let Some(found) = self.found.take() {
            show(&found);
        }
    }
}

impl Firmware for FakeDrive {
    fn tracking(&self) -> Option<Report> {
        self.tracking.as_ref().map(Tracking::report)
    }
    fn history(&self) -> &History {
        &self.history
    }
    fn begin_trace(&mut self, plan: &Plan) -> bool {
        assert!(usize::from(plan.records) <= board::TRACE_RECORDS);
        if self.tracing() {
            return false;
        }
        self.triggered = plan.trigger == Trigger::Now;
        self.plan = Some(plan.clone());
        true
    }
    fn cancel_trace(&mut self) {
        self.plan = None;
    }
    fn tracing(&self) -> bool {
        self.plan.is_some() && !self.triggered
    }
    fn traced(&self, i: u16) -> Option<(i16, trace::Record)> {
        let plan = self.plan.as_ref()?;
        let from_trigger = if plan.trigger == Trigger::Now { i } else { i.wrapping_sub(2) };
        (i < plan.records).then_some((from_trigger as i16, [1.0 / 3.0; trace::MOST]))
    }
    fn stream(&mut self, divider: u16) {
        self.streamed = (divider, VecDeque::new());
    }
    fn sampled(&mut self) -> Option<Record> {
        self.streamed.1.pop_front()
    }
    fn set_log_level(&mut self, _: Level) {}
    fn stack(&self) -> (usize, usize) {
        (1000, 8192)
    }
    fn version(&self, to: &mut dyn Write) -> fmt::Result {
        write!(to, "version")
    }
    fn last_run(&self, to: &mut dyn Write) -> fmt::Result {
        write!(to, "power-on")
    }
}

/// An accepted result of a self-commissioning.
pub fn found() -> Learned {
    let slope = SlopeTable::of_flux_saliency(Grid::REFERENCE, -0.035);
    Learned {
        reference: ReferenceTable::default(),
        slope: Some(slope),
        slope_at_rest: slope.at_rest(),
        limit_a: 2.75,
        carrier: Some(CarrierTable::default()),
        points: 13,
        spread: 0.001,
        ripple: 0.0,
        asymmetry: Asymmetry { constant: 0.0004, sin: -0.0003, cos: 0.0 },
        at_start: None,
        positions: 1,
        gain_mismatch: Fitted { value: 0.01, misfit: 0.0002, accepted: true },
        current_saliency: Fitted { value: 0.03, misfit: 0.02, accepted: true },
        flux_saliency: -0.035,
        verdict: Verdict::Sound,
    }
}

/// A serial port with limited room for replies.
#[derive(Default)]
pub struct FakePort {
    /// Bytes on their way to the console.
    pub sent: VecDeque<u8>,
    /// Whether bytes were damaged.
    pub damaged: bool,
    /// Bytes that still fit.
    pub room: usize,
    /// Replies of the console.
    pub received: String,
    /// Frames of the console.
    pub frames: Vec<Frame>,
    /// Tells frames and lines apart.
    pub splitter: Splitter,
    /// Bits per second that were set last; 0: none.
    pub baud: u32,
    /// Whether bytes are still on their way.
    pub sending: bool,
}

impl Port for FakePort {
    fn read(&mut self) -> Option<u8> {
        self.sent.pop_front()
    }
    fn take_damage(&mut self) -> bool {
        std::mem::take(&mut self.damaged)
    }
    fn write(&mut self, bytes: &[u8]) -> bool {
        let fits = bytes.len() <= self.room;
        if fits {
            self.room -= bytes.len();
            let mut text = Vec::new();
            for byte in bytes {
                match self.splitter.push(*byte) {
                    Piece::Text(byte) => text.push(byte),
                    Piece::Frame(frame) => self.frames.push(frame),
                    Piece::Nothing => {}
                    Piece::Damaged => panic!("neither text nor a frame"),
                }
            }
            self.received.push_str(std::str::from_utf8(&text).expect("text"));
        }
        fits
    }
    fn change_rate(&mut self, baud: u32) -> bool {
        if !self.sending {
            self.baud = baud;
        }
        !self.sending
    }
}

/// The port of the field bus.
#[derive(Default)]
pub struct FakeBus {
    /// Requests on their way to the drive.
    pub asked: VecDeque<modbus::Frame>,
    /// Answers of the drive.
    pub answers: VecDeque<modbus::Frame>,
    /// Rate and format that were set.
    pub line: Option<(Baud, Format)>,
    /// A stop that came while the slave was busy.
    pub stop: Option<Written>,
}

impl modbus::Port for FakeBus {
    fn set_line(&mut self, settings: &BusSettings) {
        self.line = Some((settings.baud, settings.format));
    }
    fn receive(&mut self, is_due: impl FnOnce() -> bool) -> Option<modbus::Frame> {
        if self.asked.is_empty() || !is_due() { None } else { self.asked.pop_front() }
    }
    fn send(&mut self, frame: &modbus::Frame) {
        self.answers.push_back(frame.clone());
    }
    fn set_busy(&mut self, _: bool) {}
    fn take_stop(&mut self) -> Option<Written> {
        self.stop.take()
    }
}

/// The pins of the terminals.
#[derive(Default)]
pub struct FakeTerminals {
    /// Contacts that are closed.
    pub closed: Contacts,
    /// ADC counts of reference, second reference, and motor sensor.
    pub codes: [Option<u16>; 3],
    /// Outputs that were set last.
    pub outputs: [bool; 3],
}

impl terminals::Port for FakeTerminals {
    fn look(&mut self) -> Contacts {
        self.closed
    }
    fn codes(&self) -> [Option<u16>; 3] {
        self.codes
    }
    fn show(&mut self, outputs: [bool; 3]) {
        self.outputs = outputs;
    }
}
