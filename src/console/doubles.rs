//! A drive and a wire to talk about and over where there are none: for tests and fuzzing.
extern crate std;

use core::fmt::{self, Write};
use std::collections::VecDeque;
use std::string::String;
use std::vec::Vec;

use drive_core::identify::learning::{Fitted, Learned};
use drive_core::settings::SettingsError;
use drive_core::settings::table::CarrierTable;
use drive_core::settings::table::ReferenceTable;
use drive_core::{Accepted, Coefficients, Command, Drive, Hardware, Sample, State};

use super::grammar::{LONGEST_TRACE, Level};
use super::keys::FirmwareSettings;
use super::{DriveHandle, NotDone, Port};
use crate::link::Status;
use crate::link::trace::{self, Choice};
use crate::rotor_tracking::{Report, Tracking};
use crate::store::Failed;

/// A drive on the desk.
pub struct Desk {
    /// The drive.
    pub drive: Drive,
    /// Whether its control runs.
    pub running: bool,
    /// What the converters read.
    pub sample: Sample,
    /// How many records the trace has.
    pub records: u16,
    /// What it was ordered.
    pub orders: Vec<Command>,
    /// What was saved last.
    pub saved: Option<FirmwareSettings>,
    /// Whether the flash fails.
    pub worn_out: bool,
    /// What a learning has found.
    pub found: Option<Learned>,
    /// What tracks the rotor time constant.
    pub tracking: Option<Tracking>,
}

impl Desk {
    /// One with this drive.
    pub fn new(drive: Drive) -> Self {
        Self {
            drive,
            running: true,
            sample: Sample::default(),
            records: 0,
            orders: Vec::new(),
            saved: None,
            worn_out: false,
            found: None,
            tracking: None,
        }
    }
}

impl DriveHandle for Desk {
    fn order(&mut self, order: Command) -> Result<Accepted, NotDone> {
        if !self.running {
            return Err(NotDone::NoAnswer);
        }
        self.orders.push(order);
        self.drive.command(&order).map_err(NotDone::Refused)
    }
    fn status(&self) -> Option<Status> {
        self.running.then(|| Status {
            periods: self.orders.len() as u32,
            state: self.drive.state(),
            sample: self.sample,
            telemetry: self.drive.telemetry(),
            worst_cycles: u32::MAX,
            last_cycles: 800,
            worst_latency: u32::MAX,
            hardware: Hardware::empty(),
        })
    }
    fn is_off(&self) -> bool {
        matches!(self.drive.state(), State::Off | State::Fault(_))
    }
    fn build(&mut self, settings: &FirmwareSettings) -> Result<Coefficients, SettingsError> {
        settings.build()
    }
    fn configured(&mut self, settings: &FirmwareSettings) {
        self.tracking = Tracking::new(&settings.drive);
    }
    fn tracking(&self) -> Option<Report> {
        self.tracking.as_ref().map(Tracking::report)
    }
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), Failed> {
        if self.worn_out {
            return Err(Failed::Erase(0x10));
        }
        self.saved = Some(*settings);
        Ok(())
    }
    fn begin_trace(&mut self, records: u16, _: u16, _: &Choice) -> bool {
        assert!(records <= LONGEST_TRACE);
        self.records = records;
        true
    }
    fn tracing(&self) -> bool {
        false
    }
    fn traced(&self, i: u16) -> Option<trace::Record> {
        (i < self.records).then_some([0.0; trace::MOST])
    }
    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        if let Some(found) = self.found.take() {
            show(&found);
        }
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

/// What a learning finds.
pub fn found() -> Learned {
    Learned {
        reference: ReferenceTable::default(),
        carrier: Some(CarrierTable::default()),
        points: 13,
        asymmetry: 0.001,
        gain_mismatch: Fitted { value: 0.01, misfit: 0.0002, accepted: true },
        current_saliency: Fitted { value: 0.03, misfit: 0.02, accepted: true },
        flux_saliency: -0.035,
        accepted: true,
    }
}

/// A wire with only so much room for replies.
#[derive(Default)]
pub struct Wire {
    /// Bytes on their way to the console.
    pub sent: VecDeque<u8>,
    /// Whether some were damaged.
    pub damaged: bool,
    /// Bytes that still fit.
    pub room: usize,
    /// What the console has said.
    pub received: String,
}

impl Port for Wire {
    fn read(&mut self) -> Option<u8> {
        self.sent.pop_front()
    }
    fn take_damage(&mut self) -> bool {
        core::mem::take(&mut self.damaged)
    }
    fn write(&mut self, text: &str) -> bool {
        let fits = text.len() <= self.room;
        if fits {
            self.room -= text.len();
            self.received.push_str(text);
        }
        fits
    }
}
