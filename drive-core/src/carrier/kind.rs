//! Selection of the demodulator.

/// Demodulator of the injection current, which also selects the angle-tracking loop. All except the synchronous one are for
/// comparison with the dissertation and need the feature `printed`. Without it, settings that name them are refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DemodulatorKind {
    /// The chain of the dissertation as printed. It cannot track.
    Literal,
    /// The printed chain with a rectifier.
    Rectified,
    /// Impedance difference after Ha and Sul, with the injection along the flux.
    RmsImpedance,
    /// Difference of envelopes.
    Envelope,
    /// Synchronous demodulation with a learned saliency offset.
    #[default]
    Synchronous,
}

impl DemodulatorKind {
    /// Whether this build has all demodulators, not the synchronous one alone.
    pub const HAS_ALL: bool = cfg!(feature = "printed");
    /// Smallest and largest length of the rms filters of [`RmsImpedance`](Self::RmsImpedance), samples.
    pub const RMS_SAMPLES: (u8, u8) = (2, 60);

    /// Whether the signal of the demodulator follows the angle, so that the angle can be tracked and the offset learned with it.
    pub const fn tracks(self) -> bool {
        !matches!(self, Self::Literal)
    }

    /// Whether the voltage is injected along the flux, not across it.
    pub const fn is_along_flux(self) -> bool {
        matches!(self, Self::RmsImpedance)
    }
}
