//! The operation that all demodulators have, and the band-pass that two of them share.

use crate::carrier::CarrierSample;
use crate::filter::{BPF, SosState};
use crate::math::frames::DmQm;

/// A demodulator with its state, which is at rest after [`Default`] or `new`.
pub trait Demodulate {
    /// Demodulates one sample; returns the demodulated signal.
    fn step(&mut self, sample: &CarrierSample) -> f32;
}

/// State of the band-pass on the currents of the dm and qm channels.
pub(super) type RotatedBandPass = SosState<DmQm, 2>;

/// Returns the injection currents of the dm and qm channels, A, filtered after the rotation as in
/// Figure 9. In this order the filter delays the saliency but not the angle of the frame, and the
/// speed of the frame does not appear.
pub(super) fn rotated_carrier(state: &mut RotatedBandPass, sample: &CarrierSample) -> DmQm {
    BPF.step(state, sample.current.to_dm_qm(sample.dm_axis()))
}
