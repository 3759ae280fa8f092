//! The nameplate of the motor.

use crate::math::frames::SQRT_3;

/// The data on the nameplate of the motor, for the star connection. The rules take the currents and the speed of the
/// drive from it; see [`rules`](super::rules).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nameplate {
    /// Power at the shaft, W.
    pub power_w: f32,
    /// Voltage between lines, V rms.
    pub voltage_v: f32,
    /// Current of a line, A rms.
    pub current_a: f32,
    /// Frequency, Hz.
    pub frequency_hz: f32,
    /// Speed, rpm.
    pub speed_rpm: f32,
}

impl Nameplate {
    /// The dissertation's motor, Table 3.
    pub const TABLE_3: Self = Self {
        power_w: 1100.0,
        voltage_v: 380.0,
        current_a: 2.56,
        frequency_hz: 60.0,
        speed_rpm: 1720.0,
    };

    /// Base impedance of a phase, ohm.
    pub(crate) fn base_impedance(&self) -> f32 {
        self.voltage_v / (SQRT_3 * self.current_a)
    }
}

impl Default for Nameplate {
    fn default() -> Self {
        Self::TABLE_3
    }
}
