//! The rules for the mode without identification, from the nameplate.

use core::f32::consts::TAU;

use super::{PEAK_OF_PHASE, or_rule};
use crate::flux::volts_per_hertz::{VoltsPerHertz, VoltsPerHertzSettings};
use crate::math::frames::SQRT_3;
use crate::settings::Settings;

/// Magnetising current of most motors in relation to the rated one, and largest share of the current limit for it.
const MAGNETISING: f32 = 0.45;
const OF_LIMIT: f32 = 0.6;
/// Voltage that the inverter loses at most, with 311 V.
const LOST_V: f32 = 15.0;
/// Largest rated slip that is believed.
const LARGEST_SLIP: f32 = 0.15;

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

    /// The mode without identification, where the pairs of poles fit the nameplate.
    pub(crate) fn volts_per_hertz(&self) -> Option<VoltsPerHertz> {
        let plate = &self.nameplate;
        let pole_pairs = f32::from(self.motor.pole_pairs);
        let slip_hz = plate.frequency_hz - plate.speed_rpm / 60.0 * pole_pairs;
        let fits = slip_hz > 0.0 && slip_hz < LARGEST_SLIP * plate.frequency_hz;
        fits.then(|| {
            VoltsPerHertz::new(&VoltsPerHertzSettings {
                volts_per_hz: PEAK_OF_PHASE * self.volts_per_hz(),
                rated_volts_per_hz: PEAK_OF_PHASE * plate.voltage_v / plate.frequency_hz,
                frequency_hz: plate.frequency_hz,
                slip_hz,
                torque_nm: plate.power_w / (TAU * plate.speed_rpm / 60.0),
                pole_pairs,
                rated_a: self.rated_a(),
                limit_a: self.current_limit_a(),
                boost_a: self.boost_a(),
                impedance: plate.voltage_v / (SQRT_3 * plate.current_a),
                lost_v: self.share_of_dc_link(LOST_V),
                ramp_hz_per_s: self.ramp_rpm_per_s() / 60.0 * pole_pairs,
                slip_share: self.vf.slip_share,
            })
        })
    }
}
