//! What the [commissioning](crate::commission) asks of a drive, and what it sees of it.

use crate::AlphaBeta;
use crate::drive::state::State;
use crate::protect::WiringSettings;

/// TestSignal of a motor at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum TestSignal {
    /// No voltage between the phases: the low sides are on.
    #[default]
    Rest,
    /// The pulses of the wiring check, once; then rest.
    Pulses(WiringSettings),
    /// A current along phase a.
    Current {
        /// Its reference, A.
        amperes: f32,
        /// Its controller.
        regulator: Regulator,
        /// Amplitude of the carrier along phase a and across it, V peak. Change it from one axis to the other by way of
        /// zero.
        carrier: AlphaBeta,
        /// Whether a pseudo-random binary sequence takes the place of the carrier's cosine: 255 samples of plus or minus one.
        binary: bool,
    },
}

/// A controller of the current along phase a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Regulator {
    /// Gain, V/A.
    pub k_c: f32,
    /// Zero, and pole of the reference filter.
    pub z_c: f32,
    /// Direct share of the reference beside its filter.
    pub direct: f32,
    /// Whether it regulates the current behind the filter of the current loop.
    pub filtered: bool,
}

/// The quantities of a drive that the commissioning needs beside the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TestReport {
    /// State of the drive.
    pub state: State,
    /// Starts so far, wrapping: a drive that is off again has been stopped.
    pub starts: u32,
    /// Offsets of the current sensors a and b that the start has measured, A.
    pub offsets: [f32; 2],
    /// Pulse trains that have ended since the start.
    pub trains: u32,
    /// Responses of sensors a and b to the pulses on phases a, b and c of the last train, A; positive for a sensor that
    /// is right in its own phase.
    pub answers: [[f32; 2]; 3],
}
