//! Scales of the ADCs.

/// Calibration line of one channel: `value = gain * code + offset`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Line {
    /// Units per ADC count.
    pub gain: f32,
    /// Value at 0 ADC counts.
    pub offset: f32,
}

impl Line {
    /// Channel A of the dissertation's board, Eq. 3.5.
    pub const CHANNEL_A: Self = Self { gain: 0.002_212_0, offset: -4.472_713_4 };
    /// Channel B, Eq. 3.5, with all printed digits.
    #[allow(clippy::excessive_precision)]
    pub const CHANNEL_B: Self = Self { gain: 0.002_231_4, offset: -4.496_623_8 };

    /// Returns the line of a sensor with an output of `zero_v` at zero and `v_per_unit` per ampere or volt, on an ADC
    /// with the reference `reference_v` and `codes` counts (4096 with 12 bits).
    ///
    /// ```
    /// use induction_drive_core::Line;
    ///
    /// // A shunt of 10 mohm, amplified 20 times around 1.65 V: 0.2 V/A.
    /// let line = Line::of_sensor(0.010 * 20.0, 1.65, 3.3, 4096);
    /// assert!(line.at(2048).abs() < 0.001 && (line.at(4095) - 8.25).abs() < 0.01);
    /// ```
    pub const fn of_sensor(v_per_unit: f32, zero_v: f32, reference_v: f32, codes: u16) -> Self {
        let per_volt = 1.0 / v_per_unit;
        Self { gain: per_volt * reference_v / codes as f32, offset: -per_volt * zero_v }
    }

    /// Returns the line multiplied by a factor.
    pub fn scaled(self, factor: f32) -> Self {
        Self { gain: factor * self.gain, offset: factor * self.offset }
    }

    /// Returns the value at these ADC counts.
    pub fn at(self, code: u16) -> f32 {
        self.without(0.0, code)
    }

    /// Returns the value at these ADC counts, less the `offset` of the sensor.
    pub fn without(self, offset: f32, code: u16) -> f32 {
        self.gain * f32::from(code) + (self.offset - offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f32, expected: f32) {
        assert!((value / expected - 1.0).abs() < 1e-5, "{value}, not {expected}");
    }

    #[test]
    fn a_line_gives_the_value_of_a_code() {
        let line = Line { gain: 0.002, offset: -4.0 };
        near(line.at(3000), 2.0);
        near(line.at(0), -4.0);
        near(line.scaled(1.5).at(3000), 3.0);
        near(line.scaled(1.5).at(0), -6.0);
    }
}
