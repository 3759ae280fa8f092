//! From the sampled current to the current difference `delta_i` (section 3.4, Figure 20):
//! band-pass, rotation into the dm-qm frame, difference, post-processing low-pass.

use crate::angle::UnitVector;
use crate::filters::{BPF, PP};
use crate::frames::AlphaBeta;
use crate::sos::{AlphaBetaState, SosState};

/// How the difference of the two channels is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Demodulator {
    /// `i_dm - i_qm`, as printed. The post-processing filter takes the 600 Hz out again (-76 dB):
    /// what is left is the fundamental that leaks through the band-pass (-40 dB at dc), which says
    /// nothing about the flux. Kept to show just that (Figure 19); it cannot track.
    Literal,
    /// `|i_dm| - |i_qm|`: sees the saliency. Biased by the same leak, and by the group delay of the
    /// band-pass at speed.
    #[default]
    Rectified,
}

/// State of the demodulation.
#[derive(Clone, Copy, Debug, Default)]
pub struct DemodulatorState {
    band_pass: AlphaBetaState<2>,
    post: SosState<2>,
}

impl Demodulator {
    /// `delta_i` in A from the sampled current in A; `dm_axis` is `e^(j (theta - 45°))`, delayed as
    /// the current is.
    pub fn step(
        self,
        state: &mut DemodulatorState,
        current: AlphaBeta,
        dm_axis: UnitVector,
    ) -> f32 {
        let i = BPF.step_alpha_beta(&mut state.band_pass, current).to_dm_qm(dm_axis);
        let difference = match self {
            Self::Literal => i.dm - i.qm,
            Self::Rectified => i.dm.abs() - i.qm.abs(),
        };
        PP.step(&mut state.post, difference)
    }
}
