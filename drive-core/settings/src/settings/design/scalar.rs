//! Coefficients of V/f control, for a motor that was not identified.

use crate::settings::Settings;
use crate::settings::rules::PEAK_OF_PHASE;
use drive_core::flux::{VoltsPerHertz, VoltsPerHertzSettings};

/// Largest voltage error of the inverter, with 311 V.
const LOST_V: f32 = 15.0;
/// Largest plausible rated slip.
const LARGEST_SLIP: f32 = 0.15;

impl Settings {
    /// Returns the V/f control; none if the pole pairs do not fit the nameplate.
    pub(super) fn volts_per_hertz(&self) -> Option<VoltsPerHertz> {
        let plate = &self.nameplate;
        let pole_pairs = f32::from(self.motor.pole_pairs);
        let slip_hz = plate.frequency_hz - plate.speed_rpm / 60.0 * pole_pairs;
        let fits = slip_hz > 0.0 && slip_hz < LARGEST_SLIP * plate.frequency_hz;
        let settings = VoltsPerHertzSettings {
            volts_per_hz: PEAK_OF_PHASE * self.volts_per_hz(),
            rated_volts_per_hz: PEAK_OF_PHASE * plate.voltage_v / plate.frequency_hz,
            frequency_hz: plate.frequency_hz,
            slip_hz,
            torque_nm: plate.torque_nm(),
            pole_pairs,
            rated_a: self.rated_a(),
            limit_a: self.current_limit_a(),
            boost_a: self.boost_a(),
            impedance: plate.base_impedance(),
            lost_v: self.share_of_dc_link(LOST_V),
            ramp_hz_per_s: self.ramp_rpm_per_s() / 60.0 * pole_pairs,
            quick_hz_per_s: self.quick_rpm_per_s() / 60.0 * pole_pairs,
            slip_share: self.vf.slip_share,
        };
        VoltsPerHertz::new(&settings).filter(|_| fits)
    }
}
