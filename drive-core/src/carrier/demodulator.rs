//! From the sampled current to what the carrier sees of the motor: five ways.
//!
//! All rotate the current into the dm-qm frame, 45° to either side of the injection axis, and compare
//! its two channels. With a saliency `s` (a complex number; its angle is twice that of the axis of the
//! lower inductance, seen from the injection axis) the two carrier currents are `I/sqrt2 (1 + Re s -+
//! Im s)`, so each signal below is a multiple of `Im s`: zero on the axes of the saliency, steepest there.
//!
//! | | what it gives | what it sees |
//! |---|---|---|
//! | [`Literal`] | A | the leak of the fundamental, not the saliency |
//! | [`Rectified`] | A, 0.60 of the amplitude | saliency; the leak through the band-pass as ripple |
//! | [`RmsImpedance`] | ohm | saliency, with the carrier along the flux (Ha and Sul) |
//! | [`Envelope`] | A, 0.945 of the amplitude | saliency, with the least delay behind a band-pass |
//! | [`SynchronousState`] | a pure number | saliency, whatever amplitude and inductance |
//!
//! Delay of a small change of the saliency, measured on given currents, and noise of the signal as the
//! angle that it looks like, on the simulated motor at i_q = 1 A with 5 mA rms in each current channel
//! (experiment `demodulators`):
//!
//! | | delay, samples | noise, rms | rotates |
//! |---|---|---|---|
//! | [`Rectified`] | 33.0 | 3.3° | behind the band-pass |
//! | [`RmsImpedance`], 20 samples | 42.8 | 3.8° | before it |
//! | [`Envelope`] | 14.5 | 3.6° | before it |
//! | [`SynchronousState`] | 19.0 | 2.9° | - |
//!
//! Where the rotation comes matters. A current that passed the band-pass is 8.8 samples old: seen from
//! the axis of now it also tells how fast the axis turns. At constant speed that is compensated; of
//! the tracker's own steps it is a damping, on which the printed controller (z_s = 0.90) relies. With
//! the rotation put first, the rectified chain loses the angle with that controller.

mod envelope;
mod printed;
mod rms_impedance;

pub use envelope::Envelope;
pub use printed::{Literal, Rectified};
pub use rms_impedance::{LONGEST, RmsImpedance, SHORTEST};

#[cfg(doc)]
use crate::carrier::synchronous::SynchronousState;
use crate::carrier::{CarrierSample, DemodulatorKind};
use crate::filter::dissertation::{BPF, BpfState, PP, PpState};
use crate::math::frames::{AlphaBeta, DmQm};

/// One way to demodulate: its state, fresh at [`Default`] or `new`.
pub trait Demodulate {
    /// What it gives.
    type Seen: Into<f32>;

    /// Takes one sample.
    fn step(&mut self, sample: &CarrierSample) -> Self::Seen;
}

/// The state of the way that was chosen; the synchronous one stands beside it.
// There is one, in the drive: nothing is gained by keeping a small one small.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
pub enum Demodulator {
    /// As printed.
    Literal(Literal),
    /// The same with a rectifier.
    Rectified(Rectified),
    /// Ha and Sul.
    RmsImpedance(RmsImpedance),
    /// Fritsch et al.
    Envelope(Envelope),
}

impl Demodulator {
    /// Puts one at rest in its place; `rms_samples` is the length of the rms filters of
    /// [`RmsImpedance`]. (In its place: they are large, and moving one takes longer than making it.)
    pub fn start(&mut self, tracking: DemodulatorKind, rms_samples: u8) {
        match tracking {
            DemodulatorKind::Literal | DemodulatorKind::Synchronous => {
                *self = Self::Literal(Literal::default())
            }
            DemodulatorKind::Rectified => *self = Self::Rectified(Rectified::default()),
            DemodulatorKind::RmsImpedance => {
                *self = Self::RmsImpedance(RmsImpedance::new(rms_samples))
            }
            DemodulatorKind::Envelope => *self = Self::Envelope(Envelope::default()),
        }
    }
}

impl Default for Demodulator {
    fn default() -> Self {
        Self::Literal(Literal::default())
    }
}

/// The band-pass on two signals. (Neither it nor the next is inlined: four demodulations share them,
/// and the one in a hurry does without.)
#[derive(Clone, Copy, Debug, Default)]
struct BandPass(BpfState);

impl BandPass {
    fn step(&mut self, x: AlphaBeta) -> AlphaBeta {
        BPF.step(&mut self.0, x)
    }

    /// Behind the rotation, as in Figure 9: the carrier currents of the two channels, A. In this order
    /// the filter delays what is seen and not the angle under which it is seen, and does not know how
    /// fast the frame turns.
    fn step_rotated(&mut self, sample: &CarrierSample) -> DmQm {
        let i = sample.current.to_dm_qm(sample.dm_axis());
        let carrier = self.step(AlphaBeta { alpha: i.dm, beta: i.qm });
        DmQm { dm: carrier.alpha, qm: carrier.beta }
    }
}

/// The post-processing filter.
#[derive(Clone, Copy, Debug, Default)]
struct Post(PpState);

impl Post {
    fn step(&mut self, x: f32) -> f32 {
        PP.step(&mut self.0, x)
    }
}

#[cfg(test)]
mod tests;
