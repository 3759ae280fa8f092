//! The states of the drive.

use core::fmt;

use crate::Fault;

/// The quantity that the drive regulates once it runs.
///
/// Exhaustive on purpose: who names or translates modes has to handle a new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Mode {
    /// Torque, by the current on the quadrature axis.
    Torque,
    /// Speed of the rotor; see `motion`.
    Speed,
    /// Position of the rotor. Without the encoder it drifts; see `motion`.
    Position,
    /// Speed of a motor that nobody has identified, by voltage in proportion to the frequency; see
    /// `volts_per_hertz`.
    VoltsPerHertz,
    /// Learning of the reference of the angle tracking with the shaft locked (see `crate::identify::learning`), then
    /// stops.
    Learning,
    /// [TestSignal](crate::TestSignal) of the motor at rest, for the commissioning.
    Commissioning,
}

/// The state of the drive.
///
/// Exhaustive on purpose: supervision and field bus have to decide on a new state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Outputs off.
    #[default]
    Off,
    /// Outputs off, offsets of the current sensors being measured.
    Calibrating,
    /// Low sides on, to charge the bootstrap capacitors of the high-side gate drives.
    Precharge,
    /// Short voltage pulses show whether sensors and phases belong together.
    CheckingWiring,
    /// Exciting the motor at rest, for the commissioning.
    Exciting,
    /// Current along phase a, to find the speed of a turning shaft; then its flux builds up.
    FlyingStart,
    /// Current on the direct axis only, until the flux stands.
    Magnetising,
    /// Flux built up, tracking without torque: is it the flux that is tracked?
    Verifying,
    /// Regulating torque.
    Torque,
    /// Regulating speed.
    Speed,
    /// Regulating position.
    Position,
    /// Turning by voltage and frequency.
    VoltsPerHertz,
    /// Learning with the shaft locked.
    Learning,
    /// Taking the speed to zero, then [`Stopping`](Self::Stopping).
    Braking,
    /// Taking the frequency to zero, then off: a stop by ramp from [`VoltsPerHertz`](Self::VoltsPerHertz).
    BrakingByFrequency,
    /// Taking the torque to zero, then off.
    Stopping,
    /// Outputs off until the fault is cleared.
    Fault(Fault),
}

impl State {
    /// The state in which a drive started in `mode` runs.
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

    /// The stage of a run that the state belongs to.
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

    /// The latched fault.
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::Fault(fault) => Some(fault),
            _ => None,
        }
    }

    /// Whether the outputs are off, and stay off until the next command.
    pub const fn is_off(self) -> bool {
        matches!(self.stage(), Stage::Off | Stage::Fault)
    }

    /// Whether the current is regulated in the frame of the flux, for whatever purpose: with a wiring that was found right.
    pub const fn has_current(self) -> bool {
        match self {
            Self::FlyingStart | Self::Magnetising | Self::Verifying | Self::Learning => true,
            Self::Torque | Self::Speed | Self::Position | Self::Braking | Self::Stopping => true,
            Self::Off | Self::Fault(_) | Self::Calibrating | Self::Precharge => false,
            Self::CheckingWiring | Self::Exciting => false,
            Self::VoltsPerHertz | Self::BrakingByFrequency => false,
        }
    }

    /// Whether torque, speed or position is regulated as asked for.
    pub const fn regulates(self) -> bool {
        matches!(self, Self::Torque | Self::Speed | Self::Position)
    }

    /// Whether it is coming to an end with the outputs on.
    pub const fn is_stopping(self) -> bool {
        matches!(self.stage(), Stage::Stopping)
    }
}

/// A stage of a run.
///
/// Exhaustive on purpose: supervision and field bus have to decide on a new stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Outputs off.
    Off,
    /// On the way from off to running.
    Starting,
    /// Doing what it was started for.
    Running,
    /// Coming to an end with the outputs on.
    Stopping,
    /// Outputs off until the fault is cleared.
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
            Self::VoltsPerHertz => "turning by voltage and frequency",
            Self::Learning => "learning",
            Self::Braking | Self::BrakingByFrequency => "braking to rest",
            Self::Stopping => "stopping",
            Self::Fault(fault) => return write!(f, "in fault {} ({fault})", fault.code()),
        })
    }
}
