//! Envelope detection after C. Fritsch, A. Ibanez and M. Parrilla, "A digital envelope detection filter
//! for real-time operation", IEEE Trans. Instrum. Meas. 48(6), 1999.
//!
//! Two samples of a sinusoid that are a known phase `x` apart are two equations for its amplitude and
//! phase; the amplitude, that of the analytic signal, is
//!
//! ```text
//! E^2 = ( u[k]^2 + u[k-m]^2 - 2 u[k] u[k-m] cos x ) / sin^2 x
//! ```
//!
//! The source takes neighbours; here they are two samples apart, 72°: the nearest to the 90° at which
//! noise is least. Both currents pass the band-pass first, and the difference of their envelopes is
//! averaged over one carrier period: what still leaks of the fundamental is ripple at 600 Hz and
//! 1200 Hz (the "spurious oscillations" of section 5.2), where this average has its zeros. So no
//! post-processing filter is needed, and its 24 samples of delay are saved.

use super::{BandPass, Demodulate};
use crate::carrier::CarrierSample;
use crate::carrier::injection::{CARRIER_COS, CARRIER_SAMPLES, CARRIER_SIN};
use crate::filter::moving_sum::MovingSum;
use crate::math::frames::DmQm;

/// Samples between the two.
const APART: usize = 2;
/// Units per ampere in the sum.
const UNITS: f32 = 131_072.0;

/// The difference of the envelopes of i_dm and i_qm, A.
#[derive(Clone, Copy, Debug, Default)]
pub struct Envelope {
    band_pass: BandPass,
    before: [DmQm; APART],
    index: usize,
    sum: MovingSum<1, CARRIER_SAMPLES>,
}

impl Demodulate for Envelope {
    type Seen = f32;

    fn step(&mut self, sample: &CarrierSample) -> f32 {
        let now = self.band_pass.step_rotated(sample);
        let [last, before] = self.before;
        self.before = [now, last];
        let difference = envelope(now.dm, before.dm) - envelope(now.qm, before.qm);
        let [sum] = self.sum.step(self.index, [(difference * UNITS) as i32]);
        self.index = if self.index >= CARRIER_SAMPLES - 1 { 0 } else { self.index + 1 };
        sum as f32 * (1.0 / (UNITS * CARRIER_SAMPLES as f32))
    }
}

/// Amplitude of a sinusoid from two of its samples.
fn envelope(now: f32, before: f32) -> f32 {
    let square = now * now + before * before - 2.0 * CARRIER_COS[APART] * (now * before);
    libm::sqrtf(square) * (1.0 / CARRIER_SIN[APART])
}
