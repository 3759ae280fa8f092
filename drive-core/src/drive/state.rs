//! States of the drive.

use core::fmt;

use crate::Fault;

/// Quantity that the drive regulates once it runs.
///
/// Exhaustive on purpose, so that code that names or translates the modes has to handle a new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Torque, by the q-axis current.
    Torque,
    /// Speed of the rotor; see `motion`.
    Speed,
    /// Position of the rotor. Without the encoder it drifts; see `motion`.
    Position,
    /// Speed by V/f control, for a motor that was not identified; see `volts_per_hertz`.
    VoltsPerHertz,
    /// Saliency self-commissioning with the shaft locked (see `crate::identify::learning`); then the drive stops.
    Learning,
    /// A [test signal](crate::TestSignal) to the motor at rest, for the commissioning.
    Commissioning,
}

/// State of the drive.
///
/// Exhaustive on purpose, so that supervision and field bus have to handle a new state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// The outputs are off.
    #[default]
    Off,
    /// The outputs are off, and the offsets of the current sensors are measured.
    Calibrating,
    /// The low sides are on, to charge the bootstrap capacitors of the high-side gate drives.
    Precharge,
    /// Short voltage pulses check whether sensors and phases belong together.
    CheckingWiring,
    /// Test signals are applied to the motor at rest, for the commissioning.
    Exciting,
    /// Flying start: a current along phase a shows the speed of a rotating shaft; then its flux builds up.
    FlyingStart,
    /// Current on the d axis only, until the flux is established.
    Magnetising,
    /// The flux is built up; tracking without torque verifies that the flux is tracked.
    Verifying,
    /// The torque is regulated.
    Torque,
    /// The speed is regulated.
    Speed,
    /// The position is regulated.
    Position,
    /// V/f control.
    VoltsPerHertz,
    /// Saliency self-commissioning with the shaft locked.
    Learning,
    /// The speed is reduced to zero, then [`Stopping`](Self::Stopping).
    Braking,
    /// The frequency is reduced to zero, then off: a stop by ramp from [`VoltsPerHertz`](Self::VoltsPerHertz).
    BrakingByFrequency,
    /// The torque is reduced to zero, then off.
    Stopping,
    /// The outputs are off until the fault is cleared.
    Fault(Fault),
}

impl State {
    /// Returns the state in which a drive runs that was started in `mode`.
    pub const fn of_mode(mode: Mode) -> Self {
        match mode {
            Mode::Torque => Self::Torque,
            Mode::Speed => Self::Speed,
            Mode::Position => Self::Position,
            Mode::VoltsPerHertz => Self::VoltsPerHertz,
            Mode::Learning => Self::Learning,
            Mode::Commissioning => Self::Exciting,
        }
    }

    /// Returns the stage of a run to which the state belongs.
    #[inline(always)] // out of line, 32 bytes more of control code
    pub const fn stage(self) -> Stage {
        match self {
            Self::Off => Stage::Off,
            Self::Fault(_) => Stage::Fault,
            Self::Calibrating | Self::Precharge | Self::CheckingWiring => Stage::Starting,
            Self::FlyingStart | Self::Magnetising | Self::Verifying => Stage::Starting,
            Self::Torque | Self::Speed | Self::Position | Self::VoltsPerHertz => Stage::Running,
            Self::Learning | Self::Exciting => Stage::Running,
            Self::Braking | Self::BrakingByFrequency | Self::Stopping => Stage::Stopping,
        }
    }

    /// Returns the latched fault.
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::Fault(fault) => Some(fault),
            _ => None,
        }
    }

    /// Whether the outputs are off and stay off until the next command.
    pub const fn is_off(self) -> bool {
        matches!(self.stage(), Stage::Off | Stage::Fault)
    }

    /// Whether the current is regulated in the flux frame for any purpose, which requires that the wiring was found to be right.
    pub const fn has_current(self) -> bool {
        match self {
            Self::FlyingStart | Self::Magnetising | Self::Verifying | Self::Learning => true,
            Self::Torque | Self::Speed | Self::Position | Self::Braking | Self::Stopping => true,
            Self::Off | Self::Fault(_) | Self::Calibrating | Self::Precharge => false,
            Self::CheckingWiring | Self::Exciting => false,
            Self::VoltsPerHertz | Self::BrakingByFrequency => false,
        }
    }

    /// Whether torque, speed or position is regulated as commanded.
    pub const fn regulates(self) -> bool {
        matches!(self, Self::Torque | Self::Speed | Self::Position)
    }

    /// Whether the drive is stopping with the outputs on.
    pub const fn is_stopping(self) -> bool {
        matches!(self.stage(), Stage::Stopping)
    }
}

/// Stage of a run.
///
/// Exhaustive on purpose, so that supervision and field bus have to handle a new stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The outputs are off.
    Off,
    /// Starting, with the outputs off or on.
    Starting,
    /// Running in the mode that was started.
    Running,
    /// Stopping, with the outputs on.
    Stopping,
    /// The outputs are off until the fault is cleared.
    Fault,
}

impl From<Fault> for State {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::Calibrating => "calibrating",
            Self::Precharge => "precharging",
            Self::CheckingWiring => "checking the wiring",
            Self::Exciting => "exciting the motor at rest",
            Self::FlyingStart => "looking for a turning shaft",
            Self::Magnetising => "magnetising",
            Self::Verifying => "verifying the lock",
            Self::Torque => "regulating torque",
            Self::Speed => "regulating speed",
            Self::Position => "regulating position",
            Self::VoltsPerHertz => "turning by V/f control",
            Self::Learning => "learning",
            Self::Braking | Self::BrakingByFrequency => "braking to rest",
            Self::Stopping => "stopping",
            Self::Fault(fault) => return write!(f, "in fault {} ({fault})", fault.code()),
        })
    }
}
