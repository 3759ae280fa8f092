//! Five demodulators that extract the saliency from the sampled current.
//!
//! All rotate the current into the dm-qm frame, whose axes lie 45° to either side of the injection axis,
//! and compare its two channels. With a saliency `s` (complex; its angle is twice the angle from the
//! injection axis to the axis of the lower inductance) the two injection currents are
//! `I/sqrt2 (1 + Re s -+ Im s)`, so each signal below is a multiple of `Im s`: zero on the axes of the
//! saliency, and steepest there.
//!
//! | | output | content |
//! |---|---|---|
//! | [`Literal`] | A | leakage of the fundamental, not the saliency |
//! | [`Rectified`] | A, 0.60 of the amplitude | saliency; leakage through the band-pass as ripple |
//! | [`RmsImpedance`] | ohm | saliency, with the injection along the flux (Ha and Sul) |
//! | [`Envelope`] | A, 0.945 of the amplitude | saliency, with the least delay behind a band-pass |
//! | `SynchronousState` | dimensionless | saliency, independent of amplitude and inductance |
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
//! | `SynchronousState` | 19.0 | 2.9° | - |
//!
//! The position of the rotation matters. The output of the band-pass is 8.8 samples old; resolved in the
//! present axis it also contains the speed of the axis. At constant speed this is compensated. For the
//! tracker's own corrections it acts as damping, on which the printed controller (z_s = 0.90) relies: with
//! the rotation before the band-pass, the rectified chain loses the angle with that controller.

#[cfg(feature = "printed")]
mod compared;
#[cfg(feature = "printed")]
mod envelope;
#[cfg(feature = "printed")]
mod printed;
#[cfg(feature = "printed")]
mod rms_impedance;

#[cfg(feature = "printed")]
pub use {
    compared::Demodulator,
    envelope::Envelope,
    printed::{Literal, Rectified},
    rms_impedance::RmsImpedance,
};

#[cfg(not(feature = "printed"))]
pub use absent::Demodulator;

#[cfg(feature = "printed")]
use crate::{carrier::CarrierSample, filter::BPF, filter::SosState, math::frames::DmQm};

/// A demodulator with its state, which is at rest after [`Default`] or `new`.
#[cfg(feature = "printed")]
pub trait Demodulate {
    /// Demodulates one sample; returns the demodulated signal.
    fn step(&mut self, sample: &CarrierSample) -> f32;
}

/// Replaces the compared demodulators in a build without them.
#[cfg(not(feature = "printed"))]
mod absent {
    use crate::carrier::{CarrierSample, DemodulatorKind};

    /// Placeholder for the compared demodulators, which do not exist in this build.
    #[derive(Clone, Copy, Debug, Default)]
    pub struct Demodulator;

    impl Demodulator {
        /// Does nothing.
        pub fn start(&mut self, _: DemodulatorKind, _: u8) {}

        /// Whether the demodulator rotates the output of the band-pass.
        pub fn rotates_output(&self) -> bool {
            false
        }

        /// Returns no signal.
        pub fn step(&mut self, _: &CarrierSample, _: f32) -> f32 {
            0.0
        }
    }
}

/// State of the band-pass on the currents of the dm and qm channels.
#[cfg(feature = "printed")]
type RotatedBandPass = SosState<DmQm, 2>;

/// Returns the injection currents of the dm and qm channels, A, filtered after the rotation as in
/// Figure 9. In this order the filter delays the saliency but not the angle of the frame, and the
/// speed of the frame does not appear.
#[cfg(feature = "printed")]
fn rotated_carrier(state: &mut RotatedBandPass, sample: &CarrierSample) -> DmQm {
    BPF.step(state, sample.current.to_dm_qm(sample.dm_axis()))
}

#[cfg(all(test, feature = "printed"))]
mod tests;
