//! Selection of the demodulator.

/// Demodulator of the carrier current; it also selects the angle-tracking loop. All but the synchronous one, for comparison with
/// the dissertation, need the feature `printed`; settings that name them are refused without it.
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

impl DemodulatorKind {
    /// The word of the only one that this build has; `None`: it has all.
    pub const ONLY: Option<&'static str> =
        if cfg!(feature = "printed") { None } else { Some("synchronous") };

    /// Whether its signal follows the angle, so that the angle can be tracked or learned by it.
    pub const fn tracks(self) -> bool {
        match self {
            Self::Literal => false,
            Self::Rectified | Self::RmsImpedance | Self::Envelope | Self::Synchronous => true,
        }
    }

    /// Whether the carrier is injected along the flux, not across it.
    pub const fn is_along_flux(self) -> bool {
        match self {
            Self::RmsImpedance => true,
            Self::Literal | Self::Rectified | Self::Envelope | Self::Synchronous => false,
        }
    }
}
