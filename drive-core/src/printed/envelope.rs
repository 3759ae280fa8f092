//! Envelope detection after C. Fritsch, A. Ibanez and M. Parrilla, "A digital envelope detection filter
//! for real-time operation", IEEE Trans. Instrum. Meas. 48(6), 1999.
//!
//! Two samples of a sinusoid with a known phase difference `x` determine its amplitude and phase. The
//! amplitude of the analytic signal is
//!
//! ```text
//! E^2 = ( u[k]^2 + u[k-m]^2 - 2 u[k] u[k-m] cos x ) / sin^2 x
//! ```
//!
//! The source takes neighbouring samples. Here they are two samples apart, 72°, which is closest to
//! the 90° with the lowest noise. Both currents pass the band-pass first, and the difference of their
//! envelopes is averaged over one injection period. The residual leakage of the fundamental is ripple
//! at 600 Hz and 1200 Hz (the "spurious oscillations" of section 5.2), where this average has zeros.
//! No post-processing filter is needed, which saves its delay of 24 samples.

use super::demodulate::{Demodulate, RotatedBandPass, rotated_carrier};
use crate::carrier::CarrierSample;
use crate::carrier::injection::{CARRIER_COS, CARRIER_SAMPLES, CARRIER_SIN};
use crate::filter::moving_sum::MovingSum;
use crate::math::frames::DmQm;

/// Distance of the two samples.
const APART: usize = 2;
/// Units per ampere in the moving sum.
const UNITS: f32 = 131_072.0;

/// Demodulator with output envelope(i_dm) - envelope(i_qm), A peak.
#[derive(Clone, Copy, Debug, Default)]
pub struct Envelope {
    band_pass: RotatedBandPass,
    before: [DmQm; APART],
    index: usize,
    sum: MovingSum<1, CARRIER_SAMPLES>,
}

impl Demodulate for Envelope {
    fn step(&mut self, sample: &CarrierSample) -> f32 {
        let now = rotated_carrier(&mut self.band_pass, sample);
        let [last, before] = self.before;
        self.before = [now, last];
        let difference = envelope(now.dm, before.dm) - envelope(now.qm, before.qm);
        let [sum] = self.sum.step(self.index, [(difference * UNITS) as i32]);
        self.index = if self.index >= CARRIER_SAMPLES - 1 { 0 } else { self.index + 1 };
        sum as f32 * (1.0 / (UNITS * CARRIER_SAMPLES as f32))
    }
}

/// Returns the amplitude of a sinusoid at the injection frequency from two samples [`APART`] apart.
fn envelope(now: f32, before: f32) -> f32 {
    let square = now * now + before * before - 2.0 * CARRIER_COS[APART] * (now * before);
    fpu_sqrt::sqrtf(square) * (1.0 / CARRIER_SIN[APART])
}
