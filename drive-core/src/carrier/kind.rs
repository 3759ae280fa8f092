//! Selection of the demodulator.

/// Demodulator of the carrier current; it also selects the angle-tracking loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemodulatorKind {
    /// The chain of the dissertation as printed; see [`crate::carrier::demodulator::Literal`]. It cannot track.
    Literal,
    /// The printed chain with a rectifier; see [`crate::carrier::demodulator::Rectified`].
    Rectified,
    /// Impedance difference after Ha and Sul, carrier along the flux; see
    /// [`crate::carrier::demodulator::RmsImpedance`].
    RmsImpedance,
    /// Difference of envelopes; see [`crate::carrier::demodulator::Envelope`].
    Envelope,
    /// Synchronous demodulation with a learned reference; see [`crate::carrier::synchronous`].
    #[default]
    Synchronous,
}
