//! Demodulators: five ways to extract the saliency from the sampled current.
//!
//! All rotate the current into the dm-qm frame, whose axes lie 45° to either side of the injection axis,
//! and compare its two channels. With a saliency `s` (complex; its angle is twice the angle from the
//! injection axis to the axis of the lower inductance) the two carrier currents are `I/sqrt2 (1 + Re s -+
//! Im s)`, so each signal below is a multiple of `Im s`: zero on the axes of the saliency, and steepest
//! there.
//!
//! | | output | content |
//! |---|---|---|
//! | [`Literal`] | A | leakage of the fundamental, not the saliency |
//! | [`Rectified`] | A, 0.60 of the amplitude | saliency; leakage through the band-pass as ripple |
//! | [`RmsImpedance`] | ohm | saliency, with the carrier along the flux (Ha and Sul) |
//! | [`Envelope`] | A, 0.945 of the amplitude | saliency, with the least delay behind a band-pass |
//! | [`SynchronousState`] | dimensionless | saliency, independent of amplitude and inductance |
//!
//! Delay of a small change of the saliency, measured on given currents, and noise of the signal as
//! equivalent angle, on the simulated motor at i_q = 1 A with 5 mA rms in each current channel
//! (experiment `demodulators`):
//!
//! | | delay, samples | noise, rms | rotation |
//! |---|---|---|---|
//! | [`Rectified`] | 33.0 | 3.3° | after the band-pass |
//! | [`RmsImpedance`], 20 samples | 42.8 | 3.8° | before it |
//! | [`Envelope`] | 14.5 | 3.6° | before it |
//! | [`SynchronousState`] | 19.0 | 2.9° | - |
//!
//! The position of the rotation matters. The output of the band-pass is 8.8 samples old; resolved in the
//! present axis it also contains the speed of the axis. At constant speed this is compensated. For the
//! tracker's own corrections it acts as damping, on which the printed controller (z_s = 0.90) relies: with
//! the rotation before the band-pass, the rectified chain loses the angle with that controller.

mod envelope;
mod printed;
mod rms_impedance;

pub use envelope::Envelope;
pub use printed::{Literal, PrintedChain, Rectified};
pub use rms_impedance::{MAX_RMS_SAMPLES, MIN_RMS_SAMPLES, RmsImpedance};

#[cfg(doc)]
use crate::carrier::synchronous::SynchronousState;
use crate::carrier::{CarrierSample, DemodulatorKind};
use crate::filter::dissertation::BPF;
use crate::filter::sos::SosState;
use crate::math::frames::DmQm;

/// A demodulator with its state; at rest after [`Default`] or `new`.
pub trait Demodulate {
    /// Demodulates one sample; returns the demodulated signal.
    fn step(&mut self, sample: &CarrierSample) -> f32;
}

/// The selected demodulator. The synchronous one is always present beside it, in the estimator.
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
    /// [`RmsImpedance`]. In place, because a move of the large state takes longer than its
    /// initialisation.
    pub fn start(&mut self, tracking: DemodulatorKind, rms_samples: u8) {
        use DemodulatorKind as Kind;
        match tracking {
            Kind::Literal | Kind::Synchronous => *self = Self::Literal(Literal::default()),
            Kind::Rectified => *self = Self::Rectified(Rectified::default()),
            Kind::RmsImpedance => *self = Self::RmsImpedance(RmsImpedance::new(rms_samples)),
            Kind::Envelope => *self = Self::Envelope(Envelope::default()),
        }
    }
}

impl Default for Demodulator {
    fn default() -> Self {
        Self::Literal(Literal::default())
    }
}

/// State of the band-pass on the currents of the dm and qm channels.
type RotatedBandPass = SosState<DmQm, 2>;

/// Carrier currents of the dm and qm channels, A, filtered after the rotation as in Figure 9. In
/// this order the filter delays the saliency but not the angle of the frame, and the speed of the
/// frame does not appear.
fn rotated_carrier(state: &mut RotatedBandPass, sample: &CarrierSample) -> DmQm {
    BPF.step(state, sample.current.to_dm_qm(sample.dm_axis()))
}

#[cfg(test)]
mod tests;
