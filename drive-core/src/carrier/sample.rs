//! The signals that the demodulations take and give.

use core::f32::consts::FRAC_1_SQRT_2;

use crate::carrier::injection::CarrierPeriod;
use crate::math::angle::UnitVector;
use crate::math::frames::AlphaBeta;

/// What a demodulation is given at each sample.
#[derive(Clone, Copy, Debug)]
pub struct CarrierSample {
    /// The sampled current, A.
    pub current: AlphaBeta,
    /// The injection axis `e^(j theta)`, delayed as the current that is seen from it.
    pub axis: UnitVector,
    /// The injection in this period.
    pub carrier: CarrierPeriod,
}

impl CarrierSample {
    /// The dm axis `e^(j (theta - 45°))`.
    pub(super) fn dm_axis(&self) -> UnitVector {
        self.axis.turned_by(UnitVector { cos: FRAC_1_SQRT_2, sin: -FRAC_1_SQRT_2 })
    }
}

/// What the demodulation gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Saliency {
    /// The saliency `q`; 0 where there is no carrier.
    pub q: f32,
    /// Amplitude of the carrier current along the injection axis, squared, A^2.
    pub carrier_squared: f32,
    /// The reference current, delayed as `q` is, A.
    pub i_q: f32,
}

/// The carrier current of one carrier period as complex amplitudes `(re, im)`, A.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarrierCurrent {
    /// Along the injection axis.
    pub along: (f32, f32),
    /// 90° ahead of it.
    pub across: (f32, f32),
}
