//! Communication between the main loop and the control interrupt.

pub mod mailbox;

use drive_core::{
    Accepted, Hardware, Limiting, Refused, Sample, State, Telemetry, TestReport, TorqueLimits,
};

/// The drive's answer to a command.
pub type Answer = Result<Accepted, Refused>;

/// Report of the control interrupt to the main loop, every `board::PERIODS_PER_STATUS` periods and at a change of
/// state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Status {
    /// Control periods since the start, wrapping.
    pub periods: u32,
    /// State of the drive.
    pub state: State,
    /// Last input of the drive.
    pub sample: Sample,
    /// Signals of the drive, from the [`ring`](crate::recording::ring).
    pub telemetry: Telemetry,
    /// Core cycles of the longest control period so far.
    pub worst_cycles: [u32; 2],
    /// Core cycles of the last control period.
    pub last_cycles: u32,
    /// Latest start of the control interrupt after its samples were ready, core cycles.
    pub worst_latency: u32,
    /// Events of [`Hardware`] since the last status.
    pub hardware: Hardware,
    /// Point that is being measured, from 1, and number of points, while the self-commissioning runs.
    pub learning: Option<(usize, usize)>,
    /// Reason why the torque is smaller than requested.
    pub limiting: Limiting,
    /// Limits of the torque.
    pub torque_limits: TorqueLimits,
    /// Tracked stator resistance relative to the settings, less one.
    pub stator_resistance: Option<f32>,
    /// Report of the test currents, for the commissioning.
    pub test_report: TestReport,
}
