//! What goes between the main loop and the control interrupt.

pub mod mailbox;
pub mod ring;
pub mod trace;

use drive_core::{Accepted, Hardware, Refused, Sample, State, Telemetry};

/// The drive's answer to a command.
pub type Answer = Result<Accepted, Refused>;

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
