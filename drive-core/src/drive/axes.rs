//! Axes that rotate slowly relative to the flux.

use core::f32::consts::TAU;

use crate::filter::lpf_lag_samples;
use crate::{AngleLoop, Coefficients, UnitVector};

/// Unit vectors relative to the flux at the sample, computed once an injection period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    /// The injection axis.
    pub injection: UnitVector,
    /// The injection axis at the time when the injection current flowed that is sampled now.
    pub carrier: UnitVector,
    /// The flux axis at the time when the filtered current flowed.
    pub seen: UnitVector,
    /// The flux axis at the time when the voltage will act.
    pub applied: UnitVector,
    /// The flux axis at the time when the unfiltered current of the previous sample flowed.
    pub before: UnitVector,
}

impl Default for Axes {
    /// Returns the axes with the flux at rest.
    fn default() -> Self {
        let [along, across] = [(1.0, 0.0), (0.0, 1.0)].map(|(cos, sin)| UnitVector { cos, sin });
        Self { injection: across, carrier: across, seen: along, applied: along, before: along }
    }
}

/// Periods from the sample to the middle of the period in which its voltage acts.
const VOLTAGE_LEAD: f32 = 1.5;

impl<L: AngleLoop> Coefficients<L> {
    /// Turns the axes for a flux of frequency `freq`, turns per period: back by the delays of the measured
    /// currents, and ahead to the middle of the period in which the voltage acts. `silent` means that the
    /// injection is off and the current is not filtered.
    pub(super) fn turn(&self, axes: &mut Axes, freq: f32, injection: UnitVector, silent: bool) {
        let along = UnitVector::default();
        let filter = if silent { 0.0 } else { lpf_lag_samples(freq * TAU) };
        let lag = self.lag_share * (filter + self.current_lag);
        *axes = Axes {
            injection,
            carrier: injection.turned_slightly(-freq * self.estimator.lag),
            seen: along.turned_slightly(-freq * lag),
            applied: along.turned_slightly(freq * VOLTAGE_LEAD),
            before: along.turned_slightly(-freq * (self.lag_share * self.current_lag + 1.0)),
        };
    }
}
