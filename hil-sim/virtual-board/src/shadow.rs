//! The drive on the host beside the one on the board: given the same samples and commands, it must put
//! out the same compare values.

use std::collections::VecDeque;

use anyhow::{Result, bail};
use drive_core::{Command, Drive, FrontEndState, Mode, Output, State};
use drive_settings::Settings;

use crate::board::{Options, Period, confirmed};
use induction_drive::console::grammar::{self, Request};
use induction_drive::link::ring::Record;
use induction_drive::rotor_tracking::Tracking;
use induction_drive::settings::FirmwareSettings;
use induction_drive::settings::staging::Staging;

/// A drive with the settings of the board.
pub struct Shadow {
    /// The drive.
    pub drive: Drive,
    front_end: FrontEndState,
    /// Output of its last step.
    pub output: Output,
    settings: Staging,
    /// Dead time that the timer makes since its start, s.
    dead_time_s: f32,
    orders: VecDeque<Command>,
    tracking: Option<Tracking>,
    /// Rotor time constant that the main loop is about to order, s.
    tau_r: Option<f32>,
    /// Control interrupts compared so far.
    pub compared: u64,
}

impl Shadow {
    /// The drive that the image starts with.
    ///
    /// # Errors
    /// Its settings make no drive.
    pub fn new(options: &Options) -> Result<Self> {
        let mut settings = confirmed::settings(options)?;
        if !options.confirmed {
            settings = FirmwareSettings::of(settings.board);
        }
        let dead_time_s = induction_drive::board::dead_time(settings.drive.inverter.dead_time_s).1;
        Ok(Self {
            drive: Drive::new(settings.build_for(dead_time_s)?),
            front_end: FrontEndState::default(),
            output: Output::default(),
            tracking: Tracking::new(&settings.drive),
            settings: Staging::new(settings),
            dead_time_s,
            orders: VecDeque::new(),
            tau_r: None,
            compared: 0,
        })
    }

    /// Its settings, with the dead time that the timer makes.
    pub fn settings(&self) -> Settings {
        let mut settings = self.settings.in_force().drive;
        settings.inverter.dead_time_s = self.dead_time_s;
        settings
    }

    /// A line that was typed at the console of the board.
    ///
    /// # Errors
    /// The line gives no order.
    pub fn type_line(&mut self, line: &str) -> Result<()> {
        let order = match grammar::parse(line) {
            Ok(Request::Start(mode)) => {
                self.apply()?;
                self.start(mode)
            }
            Ok(Request::Learn { again }) => {
                self.apply()?;
                let Self { settings, orders, dead_time_s, .. } = self;
                settings.begin_learning(again, |settings| -> Result<()> {
                    orders.push_back(Command::Configure(settings.build_for(*dead_time_s)?));
                    Ok(())
                })?;
                self.start(Mode::Learning)
            }
            Ok(Request::Stop(stop)) => Command::Stop(stop),
            Ok(Request::Relock) => Command::Relock,
            Ok(Request::Clear) => Command::Clear,
            Ok(Request::Torque(i_q)) => Command::Torque(i_q),
            Ok(Request::Speed(rpm)) => Command::Speed(rpm),
            Ok(Request::Jog(rpm)) => Command::Jog(rpm),
            Ok(Request::Position(turns)) => Command::Position(turns),
            Ok(Request::Set(values)) => {
                self.settings.set(&values).map_err(|why| anyhow::anyhow!("{line}: {why}"))?;
                return Ok(());
            }
            Ok(Request::Defaults) => {
                self.settings.set_defaults();
                return Ok(());
            }
            Ok(Request::Revert) => {
                self.settings.revert();
                return Ok(());
            }
            Ok(Request::Apply | Request::Save) => return self.apply(),
            Ok(_) => return Ok(()), // no order to the drive
            Err(why) => bail!("{line}: {why}"),
        };
        self.orders.push_back(order);
        Ok(())
    }

    /// The start in a mode; a check of the wiring comes before the first.
    fn start(&mut self, mode: Mode) -> Command {
        if !self.settings.in_force().command.wiring_checked {
            self.orders.push_back(Command::CheckWiring);
        }
        Command::Start(mode)
    }

    /// Puts the staged settings in force, as the firmware's console does.
    fn apply(&mut self) -> Result<()> {
        let designs = self.settings.needs_design();
        if let Some(settings) = self.settings.prepare()
            && designs
        {
            self.orders.push_back(Command::Configure(settings.build_for(self.dead_time_s)?));
        }
        self.settings.adopt();
        Ok(())
    }

    /// The board was reset: it has these settings, which were saved, and starts anew.
    ///
    /// # Errors
    /// They make no drive.
    pub fn restart(&mut self, mut settings: FirmwareSettings) -> Result<()> {
        self.settings = Staging::new(settings);
        self.drive = Drive::new(settings.build_for(self.dead_time_s)?);
        self.front_end = FrontEndState::default();
        self.orders.clear();
        Ok(())
    }

    /// All settings, with the learned table.
    pub fn firmware_settings(&self) -> &FirmwareSettings {
        self.settings.in_force()
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
            self.settings.learned(found);
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
        // As the firmware's console: a drive that is past the check need not check again.
        if self.drive.state().has_current() {
            self.settings.note(|settings| settings.command.wiring_checked = true);
        }
        if period.took_order {
            // The main loop looks after the tracking first; of a line, it may not have heard yet.
            let tracked = self.tau_r.take().map(Command::RotorTimeConstant);
            let order = tracked.or_else(|| self.orders.pop_front());
            let Some(order) = order else { bail!("an order that was not given") };
            let answer = self.drive.command(&order);
            if let (Ok(_), Command::Configure(_)) = (answer, order) {
                self.tracking = Tracking::new(&self.settings.in_force().drive);
            }
        }
        // As the firmware's main loop.
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
