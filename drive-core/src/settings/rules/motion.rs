//! The rules of the speed and the position loop.

use super::{WITHIN, or_rule};
use crate::settings::Settings;

impl Settings {
    /// Largest torque current of speed and position mode, A peak.
    pub fn i_q_limit_a(&self) -> f32 {
        or_rule(self.speed.i_q_limit_a, || 3.0 / 3.5 * self.current_limit_a())
    }

    /// Largest speed that is asked for, rpm, below that which trips: the rated speed with the observer. The injection alone is good
    /// to 300 rpm on four poles; with an encoder it may be larger.
    pub fn speed_limit_rpm(&self) -> f32 {
        let rated = self.nameplate.speed_rpm;
        let rpm = if self.uses_observer() { rated } else { self.share_of_poles(300.0) };
        or_rule(self.speed.limit_rpm, || f32::min(rpm, WITHIN * self.speed_trip_rpm()))
    }

    /// Largest acceleration that is asked for, rpm/s. Without a sensor the angle lags by 5.7 degrees while the speed
    /// changes by 300 rpm/s (four poles, tracking loop of 4 Hz).
    pub fn ramp_rpm_per_s(&self) -> f32 {
        or_rule(self.speed.ramp_rpm_per_s, || self.share_of_poles(300.0))
    }

    /// Deceleration of a quick stop, rpm/s.
    pub fn quick_rpm_per_s(&self) -> f32 {
        or_rule(self.speed.quick_rpm_per_s, || 3.0 * self.ramp_rpm_per_s())
    }
}
