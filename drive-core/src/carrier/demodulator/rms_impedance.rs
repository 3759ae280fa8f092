//! The estimator of J.-I. Ha and S.-K. Sul (1997) as the dissertation describes it (section 2.4,
//! Figure 10).
//!
//! The carrier lies along the flux (`theta = phi`, Eq. 2.12). Rms values of injected voltage and current
//! over the last `n` samples give the impedances of the two channels; their difference is zero where
//! the carrier lies on an axis of the saliency:
//!
//! ```text
//! Z_dm = rms(v_dm) / rms(i_dm)     Z_qm = rms(v_qm) / rms(i_qm)     error = F3 (Z_dm - Z_qm)
//! ```
//!
//! No source gives F3 or the length of the rms filters. Here F3 is the post-processing filter of
//! section 3.10, once, behind the difference, which is the same as on either impedance. Lengths that are
//! whole half periods of the carrier (5 samples) have no ripple before it. A step of the angle changes
//! the inverse of an rms value, so large steps are answered unevenly; within a few degrees the delay
//! is that of band-pass, rms filter, (n - 1)/2, and F3.

use super::{BandPass, Demodulate, Post};
use crate::carrier::CarrierSample;
use crate::filter::moving_sum::MovingSum;

/// Least and largest length of the rms filters, samples. One sample alone may lie on a zero of the
/// current.
pub const SHORTEST: u8 = 2;
/// See [`SHORTEST`].
pub const LONGEST: u8 = 60;

/// Units per square ampere in the sums: 2^19.
const UNITS: f32 = 524_288.0;
/// Largest square that is taken in; sixty of them fit the sum.
const LARGEST: f32 = 60.0;
/// The voltage is squared in units of 32 V: then it needs as many bits as the current.
const VOLTS: f32 = 32.0;
/// Least mean square of the current from which an impedance is made, in units: 3 mA rms.
const LEAST: i32 = 5;

/// The difference of the impedances of the dm and the qm channel, ohm; 0 where there is no carrier
/// current.
#[derive(Clone, Copy, Debug)]
pub struct RmsImpedance {
    band_pass: BandPass,
    squares: MovingSum<3, { LONGEST as usize }>,
    length: u8,
    index: u8,
    f3: Post,
}

impl RmsImpedance {
    /// With rms filters of this many samples, taken as [`SHORTEST`] to [`LONGEST`].
    pub fn new(samples: u8) -> Self {
        Self {
            band_pass: BandPass::default(),
            squares: MovingSum::default(),
            length: samples.clamp(SHORTEST, LONGEST),
            index: 0,
            f3: Post::default(),
        }
    }
}

impl Demodulate for RmsImpedance {
    type Seen = f32;

    fn step(&mut self, sample: &CarrierSample) -> f32 {
        let i = self.band_pass.step_rotated(sample);
        // The carrier's voltage lies on the bisector: the same share in both channels.
        let v = sample.carrier.voltage * (core::f32::consts::FRAC_1_SQRT_2 / VOLTS);
        let squares = [i.dm, i.qm, v].map(|x| {
            let square = x * x;
            (if square < LARGEST { square * UNITS } else { LARGEST * UNITS }) as i32
        });
        let [dm, qm, v] = self.squares.step(self.index.into(), squares);
        self.index = if self.index + 1 >= self.length { 0 } else { self.index + 1 };

        let least = LEAST * i32::from(self.length);
        let difference = if dm > least && qm > least {
            let impedance = |i: i32| libm::sqrtf(v as f32 / i as f32) * VOLTS;
            impedance(dm) - impedance(qm)
        } else {
            0.0
        };
        self.f3.step(difference)
    }
}
