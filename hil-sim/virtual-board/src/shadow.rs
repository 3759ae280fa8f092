//! The drive on the host beside the one on the board: with the same samples and commands, it must put out the same
//! compare values.

use std::collections::VecDeque;

use anyhow::{Result, bail};
use drive_core::learned::Learned;
use drive_core::{Accepted, Coefficients, Command, Drive, FrontEndState, Output, State};
use drive_settings::{Settings, SettingsError};

use crate::board::{Options, Period, confirmed};
use induction_drive::board::Timer;
use induction_drive::console::grammar::{self, Request};
use induction_drive::desk::handle::{CommandError, DriveHandle};
use induction_drive::{
    commissioning::Session, desk::Desk, link::Status, recording::ring::Record,
    rotor_tracking::Tracking, settings::Commander, settings::FirmwareSettings, store::FlashError,
};

/// A drive with the settings of the board, and its own command arbiter.
pub struct Shadow {
    /// The drive.
    pub drive: Drive,
    front_end: FrontEndState,
    /// Output of its last step.
    pub output: Output,
    desk: Desk,
    orders: Orders,
    tracking: Option<Tracking>,
    /// Rotor time constant that the main loop is about to request, s.
    tau_r: Option<f32>,
    /// Number of control interrupts compared so far.
    pub compared: u64,
}

/// The shadow's drive as its command arbiter sees it: commands wait until the interrupt of the board takes one.
struct Orders {
    waiting: VecDeque<Command>,
    state: State,
    periods: u32,
    /// Values that the timer uses since its start.
    timer: Timer,
    learned: Option<Learned>,
    session: Session,
    /// The settings with which the board starts after a reset.
    saved: FirmwareSettings,
}

impl DriveHandle for Orders {
    fn command(&mut self, command: Command) -> Result<Accepted, CommandError> {
        self.waiting.push_back(command);
        Ok(Accepted::AsGiven)
    }
    fn status(&self) -> Option<Status> {
        Some(Status { periods: self.periods, state: self.state, ..Status::default() })
    }
    fn is_off(&self) -> bool {
        self.state.is_off()
    }
    fn build(&mut self, settings: &mut FirmwareSettings) -> Result<Coefficients, SettingsError> {
        settings.build_for(&self.timer)
    }
    fn configured(&mut self, _: &FirmwareSettings) {}
    fn session(&mut self) -> &mut Session {
        &mut self.session
    }
    fn save(&mut self, settings: &FirmwareSettings) -> Result<(), FlashError> {
        self.saved = *settings;
        Ok(())
    }
    fn reboot(&mut self, _: bool) {}
    fn learned(&mut self, show: &mut dyn FnMut(&Learned)) {
        self.learned.take().iter().for_each(show);
    }
}

impl Shadow {
    /// Makes the drive with which the image starts.
    ///
    /// # Errors
    /// No drive can be made from its settings.
    pub fn new(options: &Options) -> Result<Self> {
        let settings = confirmed::settings(options)?;
        let fresh = FirmwareSettings::of(settings.board);
        Self::with(if options.confirmed { settings } else { fresh }, 0)
    }

    /// Makes the drive of a board that starts with these settings, after this number of control interrupts.
    fn with(mut settings: FirmwareSettings, compared: u64) -> Result<Self> {
        let timer = Timer::of(&settings.drive.inverter);
        let session = Session::new(&settings.drive);
        let (waiting, state, periods) = (VecDeque::new(), State::Off, compared as u32);
        let saved = settings;
        Ok(Self {
            drive: Drive::new(settings.build_for(&timer)?),
            front_end: FrontEndState::default(),
            output: Output::default(),
            tracking: Tracking::new(&settings.drive),
            desk: Desk::new(settings),
            orders: Orders { waiting, state, periods, timer, learned: None, session, saved },
            tau_r: None,
            compared,
        })
    }

    /// Returns its settings, with the dead time and the switching frequency of the timer.
    pub fn settings(&self) -> Settings {
        let mut settings = self.firmware_settings().drive;
        let Timer { dead_time_s, switching_khz, .. } = self.orders.timer;
        (settings.inverter.dead_time_s, settings.inverter.switching_khz) =
            (dead_time_s, switching_khz);
        settings
    }

    /// Processes a line that was typed at the console of the board. An invalid line and a refused request give the drive no command, on
    /// the board and here.
    pub fn type_line(&mut self, line: &str) {
        match grammar::parse(line) {
            Ok(Request::Order(order)) => {
                let _ = self.desk.order(Commander::Console, order, &mut self.orders);
                // A start follows its design in the next pass.
                (0..2).for_each(|_| self.desk.run_pending(&mut self.orders, 0));
            }
            Ok(Request::Set(values)) => {
                drop(self.desk.set(Commander::Console, &values, &self.orders))
            }
            Ok(_) | Err(_) => {}
        }
    }

    /// Restarts after a reset of the board, with the settings that were saved last.
    ///
    /// # Errors
    /// No drive can be made from them.
    pub fn restart(&mut self) -> Result<()> {
        *self = Self::with(self.orders.saved, self.compared)?;
        Ok(())
    }

    /// Returns all settings, with the learned table.
    pub fn firmware_settings(&self) -> &FirmwareSettings {
        self.desk.settings().in_force()
    }

    /// Follows a control interrupt of the board.
    ///
    /// # Errors
    /// The compare values differ.
    pub fn follow(&mut self, period: &Period) -> Result<()> {
        let learning = self.drive.state() == State::Learning;
        let compare;
        (compare, self.output) =
            self.drive.period(&mut self.front_end, &period.sample, &mut |_| {});
        if learning
            && self.drive.state() != State::Learning
            && let Some(found) = self.drive.learned()
        {
            self.orders.learned = Some(*found);
        }
        if compare != period.compare {
            bail!(
                "control interrupt {} while {}: {compare:?} on the host, {:?} on the board",
                self.compared,
                self.drive.state(),
                period.compare
            );
        }
        self.compared += 1;
        (self.orders.state, self.orders.periods) = (self.drive.state(), self.compared as u32);
        self.desk.poll_drive(&mut self.orders, self.compared as u32 / 6);
        if period.took_order {
            // The main loop first takes care of the tracking; it may not have received a line yet.
            let tracked = self.tau_r.take().map(Command::RotorTimeConstant);
            let order = tracked.or_else(|| self.orders.waiting.pop_front());
            let Some(order) = order else { bail!("an order that was not given") };
            let answer = self.drive.command(&order);
            if let (Ok(_), Command::Configure(_)) = (answer, order) {
                self.tracking = Tracking::new(&self.firmware_settings().drive);
            }
        }
        // As in the firmware's main loop.
        if self.drive.tracks_rotor()
            && let Some(tracking) = &mut self.tracking
        {
            let (period, telemetry) = (self.compared as u32, *self.drive.telemetry());
            let seen = Record { period, telemetry, ..Record::default() };
            self.tau_r = tracking.take(&seen).or(self.tau_r);
        }
        Ok(())
    }
}
