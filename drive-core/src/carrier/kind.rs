//! Selection of the demodulator.

/// Demodulator of the carrier current; it also selects the angle-tracking loop. All but the synchronous one, for comparison with
/// the dissertation, need the feature `printed`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemodulatorKind {
    /// The chain of the dissertation as printed; see [`crate::carrier::demodulator::Literal`]. It cannot track.
    #[cfg(feature = "printed")]
    Literal,
    /// The printed chain with a rectifier; see [`crate::carrier::demodulator::Rectified`].
    #[cfg(feature = "printed")]
    Rectified,
    /// Impedance difference after Ha and Sul, carrier along the flux; see
    /// [`crate::carrier::demodulator::RmsImpedance`].
    #[cfg(feature = "printed")]
    RmsImpedance,
    /// Difference of envelopes; see [`crate::carrier::demodulator::Envelope`].
    #[cfg(feature = "printed")]
    Envelope,
    /// Synchronous demodulation with a learned reference; see [`crate::carrier::synchronous`].
    #[default]
    Synchronous,
}

impl DemodulatorKind {
    /// Whether its signal follows the angle, so that the angle can be tracked or learned by it.
    pub const fn tracks(self) -> bool {
        match self {
            #[cfg(feature = "printed")]
            Self::Literal => false,
            _ => true,
        }
    }

    /// Whether the carrier is injected along the flux, not across it.
    pub const fn is_along_flux(self) -> bool {
        match self {
            #[cfg(feature = "printed")]
            Self::RmsImpedance => true,
            _ => false,
        }
    }
}
