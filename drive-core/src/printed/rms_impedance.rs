//! Impedance estimator of J.-I. Ha and S.-K. Sul (1997) as the dissertation describes it (section 2.4,
//! Figure 10).
//!
//! The injection lies along the flux (`theta = phi`, Eq. 2.12). Rms values of injected voltage and
//! injection current over the last `n` samples give the impedances of the two channels. Their difference
//! is zero when the injection lies on an axis of the saliency:
//!
//! ```text
//! Z_dm = rms(v_dm) / rms(i_dm)     Z_qm = rms(v_qm) / rms(i_qm)     error = F3 (Z_dm - Z_qm)
//! ```
//!
//! No source gives F3 or the length of the rms filters. Here F3 is the post-processing filter of section
//! 3.10, applied once to the difference, which equals applying it to both impedances. Lengths of whole
//! half periods of the injection (5 samples) cause no ripple. A step of the angle changes the inverse of
//! an rms value, so the response to large steps is nonlinear; within a few degrees the delay is the sum
//! of band-pass, rms filter, (n - 1)/2, and F3.

use super::demodulate::{Demodulate, RotatedBandPass, rotated_carrier};
use crate::carrier::{CarrierSample, DemodulatorKind};
use crate::filter::PP;
use crate::filter::dissertation::PpState;
use crate::filter::moving_sum::MovingSum;

/// Units per square ampere in the sums: 2^19.
const UNITS: f32 = 524_288.0;
/// Upper clamp of a square, in A^2 or [`VOLTS`]^2; sixty of them fit the sum.
const LARGEST: f32 = 60.0;
/// Voltage unit of the squares, V: the voltage then needs as many bits as the current.
const VOLTS: f32 = 32.0;
/// Minimum mean square of the current for a valid impedance, in units: 3 mA rms.
const LEAST: i32 = 5;

/// Demodulator with output F3 (Z_dm - Z_qm), ohm; the difference counts as 0 without injection current.
#[derive(Clone, Copy, Debug)]
pub struct RmsImpedance {
    band_pass: RotatedBandPass,
    squares: MovingSum<3, { DemodulatorKind::RMS_SAMPLES.1 as usize }>,
    length: u8,
    index: u8,
    f3: PpState,
}

impl RmsImpedance {
    /// Creates a demodulator at rest, with rms filters of `samples`, clamped to [`DemodulatorKind::RMS_SAMPLES`].
    pub fn new(samples: u8) -> Self {
        Self {
            band_pass: RotatedBandPass::default(),
            squares: MovingSum::default(),
            length: samples.clamp(DemodulatorKind::RMS_SAMPLES.0, DemodulatorKind::RMS_SAMPLES.1),
            index: 0,
            f3: PpState::default(),
        }
    }
}

impl Demodulate for RmsImpedance {
    fn step(&mut self, sample: &CarrierSample) -> f32 {
        let i = rotated_carrier(&mut self.band_pass, sample);
        // The injected voltage lies on the bisector, so both channels have equal components.
        let v = sample.carrier.voltage * (core::f32::consts::FRAC_1_SQRT_2 / VOLTS);
        let squares = [i.dm, i.qm, v].map(|x| {
            let square = x * x;
            (if square < LARGEST { square * UNITS } else { LARGEST * UNITS }) as i32
        });
        let [dm, qm, v] = self.squares.step(self.index.into(), squares);
        self.index = if self.index + 1 >= self.length { 0 } else { self.index + 1 };

        let least = LEAST * i32::from(self.length);
        let difference = if dm > least && qm > least {
            let impedance = |i: i32| fpu_sqrt::sqrtf(v as f32 / i as f32) * VOLTS;
            impedance(dm) - impedance(qm)
        } else {
            0.0
        };
        PP.step(&mut self.f3, difference)
    }
}
