//! A drive as the battery sees it, so that it can run another drive than this one.

use std::fmt;

use drive_core::{Accepted, Command, Compare, Drive, Mode, Sample, State, Stop};

/// What the drive is started for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To regulate torque.
    Torque,
    /// To regulate speed.
    Speed,
    /// To learn, with the shaft locked.
    Learning,
}

/// What the drive does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Outputs off.
    Off,
    /// On the way to its purpose, or learning.
    Busy,
    /// Regulating torque or speed.
    Regulating,
    /// Stopped by the fault of this number.
    Fault(u8),
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::Busy => f.write_str("busy"),
            Self::Regulating => f.write_str("regulating"),
            Self::Fault(code) => write!(f, "stopped by fault {code}"),
        }
    }
}

/// A drive in a state that can be copied: every run begins with a copy of the same one.
pub trait DriveUnderTest: Clone + Send + Sync {
    /// One control period.
    fn step(&mut self, sample: &Sample) -> Compare;
    /// Starts.
    ///
    /// # Errors
    /// The reason why it does not.
    fn start(&mut self, purpose: Purpose) -> Result<(), String>;
    /// Gives a torque current, A peak; returns that which the drive takes. It may limit it.
    ///
    /// # Errors
    /// The reason why it is refused.
    fn torque(&mut self, i_q: f32) -> Result<f32, String>;
    /// Gives a speed, mechanical rpm.
    ///
    /// # Errors
    /// The reason why it is refused.
    fn speed(&mut self, rpm: f32) -> Result<(), String>;
    /// Stops; a drive that does not know how goes on.
    fn stop(&mut self) {}
    /// Duty that it gives the brake chopper, 0 to 1.
    fn chopper(&self) -> f64 {
        0.0
    }
    /// What it does.
    fn condition(&self) -> Condition;
    /// Its estimate of the angle of the rotor flux at the last sample, electrical turns.
    fn flux_turns(&self) -> f64;
}

impl DriveUnderTest for Drive {
    fn step(&mut self, sample: &Sample) -> Compare {
        Self::step(self, sample)
    }

    fn start(&mut self, purpose: Purpose) -> Result<(), String> {
        let mode = match purpose {
            Purpose::Torque => Mode::Torque,
            Purpose::Speed => Mode::Speed,
            Purpose::Learning => Mode::Learning,
        };
        command(self, &Command::Start(mode))
    }

    fn torque(&mut self, i_q: f32) -> Result<f32, String> {
        match Self::command(self, &Command::Torque(i_q)) {
            Ok(Accepted::Limited(taken)) => Ok(taken),
            Ok(_) => Ok(i_q),
            Err(refused) => Err(refused.to_string()),
        }
    }

    fn speed(&mut self, rpm: f32) -> Result<(), String> {
        command(self, &Command::Speed(rpm))
    }

    fn stop(&mut self) {
        // Refused by a drive that is not on.
        let _ = command(self, &Command::Stop(Stop::Coast));
    }

    fn chopper(&self) -> f64 {
        self.brake_duty().into()
    }

    fn condition(&self) -> Condition {
        match self.state() {
            State::Off => Condition::Off,
            State::Torque | State::Speed | State::Position => Condition::Regulating,
            State::Fault(fault) => Condition::Fault(fault.code()),
            _ => Condition::Busy,
        }
    }

    fn flux_turns(&self) -> f64 {
        self.telemetry().phi.to_turns().into()
    }
}

fn command(drive: &mut Drive, command: &Command) -> Result<(), String> {
    drive.command(command).map(|_| ()).map_err(|refused| refused.to_string())
}
