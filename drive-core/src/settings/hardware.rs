//! Scales and sensors.

use super::value::words;

/// Calibration line of one channel: `value = gain * code + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Units per code.
    pub gain: f32,
    /// Value at code 0.
    pub offset: f32,
}

impl Line {
    /// Channel A of the dissertation's board, Eq. 3.5.
    pub const CHANNEL_A: Self = Self { gain: 0.002_212_0, offset: -4.472_713_4 };
    /// Channel B, Eq. 3.5, with all printed digits.
    #[allow(clippy::excessive_precision)]
    pub const CHANNEL_B: Self = Self { gain: 0.002_231_4, offset: -4.496_623_8 };

    /// The line of a sensor that gives `zero_v` at zero and `v_per_unit` more per ampere or volt, behind a converter with
    /// the reference `reference_v` and `codes` codes (4096 with 12 bits).
    ///
    /// ```
    /// use drive_core::settings::Line;
    ///
    /// // A shunt of 10 mohm, amplified 20 times around 1.65 V: 0.2 V/A.
    /// let line = Line::of_sensor(0.010 * 20.0, 1.65, 3.3, 4096);
    /// assert!(line.at(2048).abs() < 0.001 && (line.at(4095) - 8.25).abs() < 0.01);
    /// ```
    pub const fn of_sensor(v_per_unit: f32, zero_v: f32, reference_v: f32, codes: u16) -> Self {
        let per_volt = 1.0 / v_per_unit;
        Self { gain: per_volt * reference_v / codes as f32, offset: -per_volt * zero_v }
    }

    /// The line multiplied by a factor.
    pub fn scaled(self, factor: f32) -> Self {
        Self { gain: factor * self.gain, offset: factor * self.offset }
    }

    /// Value at a code.
    pub fn at(self, code: u16) -> f32 {
        self.without(0.0, code)
    }

    /// Value at a code, less the `offset` of the sensor.
    pub fn without(self, offset: f32, code: u16) -> f32 {
        self.gain * f32::from(code) + (self.offset - offset)
    }
}

/// Sensors of the phase currents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentSensors {
    /// Two, in the lines a and b.
    InLine,
    /// Three shunts below the low sides.
    LowSide,
}

words!(CurrentSensors { Self::InLine => CurrentSensors::InLine, "in-line"; Self::LowSide => CurrentSensors::LowSide, "low-side"; });
