//! What the [commissioning](crate::commission) asks of a drive, and what it sees of it.

use crate::drive::state::State;
use crate::math::frames::AlphaBeta;
use crate::protect::wiring_check::WiringSettings;

/// Excitation of a motor at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Excitation {
    /// No voltage between the phases: the low sides are on.
    #[default]
    Rest,
    /// The pulses of the [wiring check](crate::protect::wiring_check), once; then rest.
    Pulses(WiringSettings),
    /// A current along phase a.
    Current {
        /// Its reference, A.
        amperes: f32,
        /// Transient inductance that its controller is designed for, H.
        inductance: f32,
        /// Amplitude of the carrier along phase a and across it, V peak. Change it from one axis to the other by way of
        /// zero.
        carrier: AlphaBeta,
    },
}

/// The quantities of a drive that the commissioning needs beside the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Excited {
    /// State of the drive.
    pub state: State,
    /// Offsets of the current sensors a and b that the start has measured, A.
    pub offsets: [f32; 2],
    /// Pulse trains that have ended since the start.
    pub trains: u32,
    /// Responses of sensors a and b to the pulses on phases a, b and c of the last train, A; positive for a sensor that
    /// is right in its own phase.
    pub answers: [[f32; 2]; 3],
}
