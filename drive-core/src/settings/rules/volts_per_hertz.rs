//! The rules for the mode without identification, from the nameplate.

use super::or_rule;
use crate::settings::Settings;

/// Magnetising current of most motors in relation to the rated one, and largest share of the current limit for it.
const MAGNETISING: f32 = 0.45;
const OF_LIMIT: f32 = 0.6;

impl Settings {
    /// Voltage between lines, rms, per frequency, V/Hz: the nameplate's.
    pub fn volts_per_hz(&self) -> f32 {
        let plate = &self.nameplate;
        or_rule(self.vf.volts_per_hz, || plate.voltage_v / plate.frequency_hz)
    }

    /// Current of the standing motor, A peak.
    pub fn boost_a(&self) -> f32 {
        let rule = || f32::min(MAGNETISING * self.rated_a(), OF_LIMIT * self.current_limit_a());
        or_rule(self.vf.boost_a, rule)
    }
}
