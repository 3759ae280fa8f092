//! The axes that are used beside that of the flux.

use core::f32::consts::TAU;

use crate::drive::coefficients::Coefficients;
use crate::filter::dissertation::lpf_lag_samples;
use crate::math::angle::UnitVector;

/// What turns slowly against the flux, as unit vectors seen from where it is at the sample; new once a
/// carrier period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    /// The injection axis, seen from the flux.
    pub injection: UnitVector,
    /// The same where the flux was when the carrier current flowed that is sampled now.
    pub carrier: UnitVector,
    /// The flux when the filtered current flowed.
    pub seen: UnitVector,
    /// The flux when the voltage will act.
    pub applied: UnitVector,
}

impl Default for Axes {
    /// With the flux at rest.
    fn default() -> Self {
        let [along, across] = [(1.0, 0.0), (0.0, 1.0)].map(|(cos, sin)| UnitVector { cos, sin });
        Self { injection: across, carrier: across, seen: along, applied: along }
    }
}

/// Periods from the sample to the middle of the period in which its voltage acts.
const VOLTAGE_LEAD: f32 = 1.5;

impl Coefficients {
    /// The current is seen from where the flux was when the filtered current flowed; the voltage is put
    /// where the flux will be when it acts. `step` is how far the flux turns in a period, turns.
    pub(super) fn turn(&self, axes: &mut Axes, step: f32, injection: UnitVector) {
        let along = UnitVector { cos: 1.0, sin: 0.0 };
        let lag = self.lag_share * (lpf_lag_samples(step * TAU) + self.current_lag);
        *axes = Axes {
            injection,
            carrier: injection.turned_slightly(-step * self.estimator.lag),
            seen: along.turned_slightly(-step * lag),
            applied: along.turned_slightly(step * VOLTAGE_LEAD),
        };
    }
}
