//! What goes between the main loop and the control interrupt.

pub mod mailbox;
pub mod ring;
pub mod trace;

use drive_core::{Coefficients, Command, Hardware, Mode, Refused, Sample, State, Taken, Telemetry};

/// From the main loop to the drive.
// The large one is there at most once, in a mailbox.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// See [`Command::Start`].
    Start(Mode),
    /// See [`Command::CheckWiring`].
    CheckWiring,
    /// See [`Command::Stop`].
    Stop,
    /// See [`Command::Relock`].
    Relock,
    /// See [`Command::Clear`].
    Clear,
    /// See [`Command::Torque`].
    Torque(f32),
    /// See [`Command::Speed`].
    Speed(f32),
    /// See [`Command::Position`].
    Position(f32),
    /// See [`Command::RotorTimeConstant`].
    RotorTimeConstant(f32),
    /// See [`Command::Configure`].
    Configure(Coefficients),
}

impl Order {
    /// As the drive takes it.
    pub fn command(&self) -> Command<'_> {
        match self {
            Self::Start(mode) => Command::Start(*mode),
            Self::CheckWiring => Command::CheckWiring,
            Self::Stop => Command::Stop,
            Self::Relock => Command::Relock,
            Self::Clear => Command::Clear,
            Self::Torque(i_q) => Command::Torque(*i_q),
            Self::Speed(rpm) => Command::Speed(*rpm),
            Self::Position(turns) => Command::Position(*turns),
            Self::RotorTimeConstant(tau_r) => Command::RotorTimeConstant(*tau_r),
            Self::Configure(coefficients) => Command::Configure(coefficients),
        }
    }
}

/// What the drive makes of an [`Order`].
pub type Answer = Result<Taken, Refused>;

/// What the main loop hears from the interrupt, `board::PERIODS_PER_STATUS` apart.
#[derive(Clone, Copy, Debug, Default)]
pub struct Status {
    /// Control periods since the start, wrapping.
    pub periods: u32,
    /// What the drive is doing.
    pub state: State,
    /// What the drive was last given.
    pub sample: Sample,
    /// What the drive made of it.
    pub telemetry: Telemetry,
    /// Core cycles of the longest control period so far.
    pub worst_cycles: u32,
    /// Core cycles of the last control period.
    pub last_cycles: u32,
    /// Latest start of the control interrupt after its samples were ready, core cycles.
    pub worst_latency: u32,
    /// Events of [`Hardware`] since the last status.
    pub hardware: Hardware,
}
