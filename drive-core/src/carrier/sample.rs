//! Input and output signals of the demodulators.

use crate::carrier::injection::CarrierPeriod;
use crate::{AlphaBeta, UnitVector};

/// Input of a demodulator, one per control period.
#[derive(Clone, Copy, Debug)]
pub struct CarrierSample {
    /// Sampled stator current, A peak.
    pub current: AlphaBeta,
    /// Injection axis `e^(j theta)` in the stator frame, delayed by the lag of the sampled current.
    pub axis: UnitVector,
    /// The injection in this period.
    pub carrier: CarrierPeriod,
}

impl CarrierSample {
    /// Returns the dm axis `e^(j (theta - 45°))`.
    #[cfg(feature = "printed")]
    pub(crate) fn dm_axis(&self) -> UnitVector {
        const HALF: f32 = core::f32::consts::FRAC_1_SQRT_2;
        self.axis.turned_by(UnitVector { cos: HALF, sin: -HALF })
    }
}

/// Output of the synchronous demodulation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Saliency {
    /// Saliency component `q` across the injection axis, dimensionless; 0 without injection.
    pub q: f32,
    /// Squared amplitude of the injection current along the injection axis, A^2.
    pub carrier_squared: f32,
    /// Q-axis current reference, averaged and delayed like `q`, A.
    pub i_q: f32,
}

/// Injection current of one injection period as complex amplitudes `(re, im)`, A peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarrierCurrent {
    /// Component along the injection axis.
    pub along: (f32, f32),
    /// Component 90° ahead of the injection axis.
    pub across: (f32, f32),
}
