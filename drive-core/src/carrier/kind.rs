//! The choice among the demodulations.

/// How the carrier is demodulated and the angle tracked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemodulatorKind {
    /// The chain of the dissertation as printed; see [`crate::carrier::demodulator::Literal`]. It cannot track.
    Literal,
    /// The same with a rectifier; see [`crate::carrier::demodulator::Rectified`].
    Rectified,
    /// Ha and Sul, with the carrier along the flux; see [`crate::carrier::demodulator::RmsImpedance`].
    RmsImpedance,
    /// Difference of envelopes; see [`crate::carrier::demodulator::Envelope`].
    Envelope,
    /// Synchronous demodulation with a learned reference; see [`crate::carrier::synchronous`].
    #[default]
    Synchronous,
}
