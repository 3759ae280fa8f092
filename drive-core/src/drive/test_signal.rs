//! Interface of the [commissioning](crate::commission) to the drive: test signals, and a report of the drive.

use crate::AlphaBeta;
use crate::drive::state::State;
use crate::protect::WiringSettings;

/// A test signal to a motor at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum TestSignal {
    /// No voltage between the phases, with the low sides on.
    #[default]
    Rest,
    /// The pulses of the wiring check, once; then rest.
    Pulses(WiringSettings),
    /// A current along phase a.
    Current {
        /// Reference of the current, A.
        amperes: f32,
        /// Controller of the current.
        regulator: Regulator,
        /// Amplitude of the injection along phase a and across it, V peak. Go through zero to change from one axis to
        /// the other.
        carrier: AlphaBeta,
        /// Whether a pseudo-random binary sequence, 255 samples of plus or minus one, replaces the cosine of the injection.
        binary: bool,
    },
}

/// A controller of the current along phase a.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Regulator {
    /// Gain, V/A.
    pub k_c: f32,
    /// Zero, which is also the pole of the reference filter.
    pub z_c: f32,
    /// Direct share of the reference beside its filter.
    pub direct: f32,
    /// Whether the controller uses the current after the filter of the current loop.
    pub filtered: bool,
}

/// Quantities of a drive that the commissioning needs in addition to the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TestReport {
    /// State of the drive.
    pub state: State,
    /// Number of starts so far, wrapping. If the drive is off again after the same start, it has been stopped.
    pub starts: u32,
    /// Offsets of the current sensors a and b that the start has measured, A.
    pub offsets: [f32; 2],
    /// Number of pulse trains that have ended since the start.
    pub trains: u32,
    /// Responses of sensors a and b to the pulses on phases a, b and c of the last train, A; positive if a sensor in
    /// the pulsed phase has the right polarity.
    pub answers: [[f32; 2]; 3],
}
