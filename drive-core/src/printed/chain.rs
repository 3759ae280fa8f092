//! The chain of section 3.4 (Figure 20): band-pass, rotation into the dm-qm frame, difference,
//! post-processing low-pass.

use super::demodulate::Demodulate;
use crate::carrier::CarrierSample;
use crate::filter::dissertation::{BpfState, PpState};
use crate::filter::{BPF, PP};

/// Demodulator with output `i_dm - i_qm`, A, as printed. The post-processing filter removes the 600 Hz
/// (-76 dB). The rest is the fundamental that leaks through the band-pass (-40 dB at dc) and carries no
/// information on the flux. The chain is kept to demonstrate this (Figure 19) and cannot track.
pub type Literal = PrintedChain<false>;

/// Demodulator with output `|i_dm| - |i_qm|`, A, which contains the saliency. It is biased by the same
/// leakage, and at speed by the group delay of the band-pass.
pub type Rectified = PrintedChain<true>;

/// The printed chain with or without the rectifier.
#[derive(Clone, Copy, Debug, Default)]
pub struct PrintedChain<const RECTIFIED: bool> {
    band_pass: BpfState,
    post: PpState,
}

impl<const RECTIFIED: bool> Demodulate for PrintedChain<RECTIFIED> {
    fn step(&mut self, sample: &CarrierSample) -> f32 {
        let carrier = BPF.step(&mut self.band_pass, sample.current);
        let i = carrier.to_dm_qm(sample.dm_axis());
        let difference = if RECTIFIED { i.dm.abs() - i.qm.abs() } else { i.dm - i.qm };
        PP.step(&mut self.post, difference)
    }
}
