//! The chain of section 3.4 (Figure 20): band-pass, rotation into the dm-qm frame, difference,
//! post-processing low-pass.

use super::{BandPass, Demodulate, PostFilter};
use crate::carrier::CarrierSample;
use crate::math::frames::DmQm;

/// Demodulator with output `i_dm - i_qm`, A, as printed. The post-processing filter removes the 600 Hz
/// (-76 dB); the rest is the fundamental that leaks through the band-pass (-40 dB at dc) and carries no
/// information on the flux. Kept to demonstrate this (Figure 19); it cannot track.
#[derive(Clone, Copy, Debug, Default)]
pub struct Literal(Chain);

/// Demodulator with output `|i_dm| - |i_qm|`, A, which contains the saliency. Biased by the same leakage,
/// and at speed by the group delay of the band-pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rectified(Chain);

/// State of the filters.
#[derive(Clone, Copy, Debug, Default)]
struct Chain {
    band_pass: BandPass,
    post: PostFilter,
}

impl Chain {
    fn step(&mut self, sample: &CarrierSample, difference: impl Fn(DmQm) -> f32) -> f32 {
        let carrier = self.band_pass.step(sample.current);
        self.post.step(difference(carrier.to_dm_qm(sample.dm_axis())))
    }
}

impl Demodulate for Literal {
    type Output = f32;

    fn step(&mut self, sample: &CarrierSample) -> f32 {
        self.0.step(sample, |i| i.dm - i.qm)
    }
}

impl Demodulate for Rectified {
    type Output = f32;

    fn step(&mut self, sample: &CarrierSample) -> f32 {
        self.0.step(sample, |i| i.dm.abs() - i.qm.abs())
    }
}
