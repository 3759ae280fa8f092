//! Selection among the compared demodulators.

use super::demodulate::Demodulate;
use super::{DemodulatorKind, Envelope, Literal, Rectified, RmsImpedance};
use crate::carrier::CarrierSample;

/// The selected demodulator. The synchronous demodulator is always present in addition, in the estimator.
// The drive has a single instance, so the size of the small variants does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Demodulator {
    /// The chain as printed.
    Literal(Literal),
    /// The printed chain with a rectifier.
    Rectified(Rectified),
    /// Impedance difference after Ha and Sul.
    RmsImpedance(RmsImpedance),
    /// Envelope difference after Fritsch et al.
    Envelope(Envelope),
}

impl Demodulator {
    /// Starts the selected demodulator at rest; `rms_samples` is the length of the rms filters of
    /// [`RmsImpedance`]. The state is initialised in place, because a move of the large state takes
    /// longer.
    pub fn start(&mut self, tracking: DemodulatorKind, rms_samples: u8) {
        use DemodulatorKind as Kind;
        match tracking {
            Kind::Literal | Kind::Synchronous => *self = Self::Literal(Literal::default()),
            Kind::Rectified => *self = Self::Rectified(Rectified::default()),
            Kind::RmsImpedance => *self = Self::RmsImpedance(RmsImpedance::new(rms_samples)),
            Kind::Envelope => *self = Self::Envelope(Envelope::default()),
        }
    }

    /// Whether the demodulator rotates the output of the band-pass.
    pub fn rotates_output(&self) -> bool {
        match self {
            Self::Literal(_) | Self::Rectified(_) => true,
            Self::RmsImpedance(_) | Self::Envelope(_) => false,
        }
    }

    /// Demodulates one sample, A; an impedance difference is converted by `ampere_per_ohm`.
    pub fn step(&mut self, sample: &CarrierSample, ampere_per_ohm: f32) -> f32 {
        match self {
            Self::Literal(d) => d.step(sample),
            Self::Rectified(d) => d.step(sample),
            Self::RmsImpedance(d) => ampere_per_ohm * d.step(sample),
            Self::Envelope(d) => d.step(sample),
        }
    }
}

impl Default for Demodulator {
    fn default() -> Self {
        Self::Literal(Literal::default())
    }
}
