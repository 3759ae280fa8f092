//! Selection of the demodulator.

/// Demodulator of the carrier current; it also selects the angle-tracking loop. All but the synchronous one, for comparison with
/// the dissertation, need the feature `printed`; settings that name them are refused without it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemodulatorKind {
    /// The chain of the dissertation as printed. It cannot track.
    Literal,
    /// The printed chain with a rectifier.
    Rectified,
    /// Impedance difference after Ha and Sul, carrier along the flux.
    RmsImpedance,
    /// Difference of envelopes.
    Envelope,
    /// Synchronous demodulation with a learned reference.
    #[default]
    Synchronous,
}

impl DemodulatorKind {
    /// Whether this build has all of them, not the synchronous one alone.
    pub const HAS_ALL: bool = cfg!(feature = "printed");
    /// Smallest and largest length of the rms filters of [`RmsImpedance`](Self::RmsImpedance), samples.
    pub const RMS_SAMPLES: (u8, u8) = (2, 60);

    /// Whether its signal follows the angle, so that the angle can be tracked or learned by it.
    pub const fn tracks(self) -> bool {
        !matches!(self, Self::Literal)
    }

    /// Whether the carrier is injected along the flux, not across it.
    pub const fn is_along_flux(self) -> bool {
        matches!(self, Self::RmsImpedance)
    }
}
