//! Quantities that follow from the nameplate of the motor.

use super::Nameplate;
use drive_core::SQRT_3;

impl Nameplate {
    /// Base impedance of a phase, ohm.
    pub fn base_impedance(&self) -> f32 {
        self.voltage_v / (SQRT_3 * self.current_a)
    }
}
