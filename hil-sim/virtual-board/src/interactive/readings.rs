//! The telemetry of the drive on the board, read from the RAM of the core.

use crate::board::Board;

/// Telemetry of the last control interrupt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Readings {
    /// Estimated rotor-flux angle, electrical turns.
    pub phi: f64,
    /// Estimated electrical speed of the rotor, turns per period.
    pub rotor_freq: f64,
    /// Filtered reference on the quadrature axis, A.
    pub reference_q: f64,
    /// Current on the quadrature axis, A.
    pub current_q: f64,
    /// Dc-link voltage, V.
    pub dc_link: f64,
}

impl Readings {
    /// Reads the telemetry, after a control interrupt.
    pub fn new(board: &Board) -> Self {
        let at = board.addresses();
        let float = |address| f64::from(f32::from_bits(board.word(address).unwrap_or_default()));
        Self {
            phi: board.flux_angle(),
            rotor_freq: float(at.rotor_freq),
            reference_q: float(at.reference_q),
            current_q: float(at.current_q),
            dc_link: float(at.dc_link),
        }
    }
}
