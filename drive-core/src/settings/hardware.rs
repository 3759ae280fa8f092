//! Timer, power stage, converters and encoder.

use super::Ntc;
use super::value::words;

/// The timer and the power stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inverter {
    /// Value at which the counter turns round: 14167 at 170 MHz and 6 kHz.
    pub top: u16,
    /// Nominal voltage of the dc link, V.
    pub dc_link_v: f32,
    /// Dead time, s.
    pub dead_time_s: f32,
    /// Whether the dead time is compensated.
    pub compensate: bool,
    /// Phase current from which on the compensation is full, A; unset: by rule.
    pub full_compensation_a: Option<f32>,
    /// Voltage per phase that is lost beyond the dead time, V, as the commissioning found it; unset: measured at every
    /// start.
    pub drop_v: Option<f32>,
}

impl Default for Inverter {
    /// Section 3.9; 220 V rectified.
    fn default() -> Self {
        Self {
            top: 14_167,
            dc_link_v: 311.0,
            dead_time_s: 2.2e-6,
            compensate: true,
            full_compensation_a: None,
            drop_v: None,
        }
    }
}

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
        self.gain * f32::from(code) + self.offset
    }
}

/// Sensors of the phase currents.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurrentSensors {
    /// Two, in the lines a and b.
    #[default]
    InLine,
    /// Three shunts below the low sides.
    LowSide,
}

words!(CurrentSensors { Self::InLine => CurrentSensors::InLine, "in-line"; Self::LowSide => CurrentSensors::LowSide, "low-side"; });

/// Scales of the converters and of the encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Current a, A.
    pub current_a: Line,
    /// Current b, A.
    pub current_b: Line,
    /// Current c, A; for three shunts.
    pub current_c: Line,
    /// Kind of the sensors.
    pub sensors: CurrentSensors,
    /// Time from the turn-on of a low side until its shunt can be sampled, without the dead time, s.
    pub shunt_settle_s: f32,
    /// Dc-link voltage, V.
    pub dc_link: Line,
    /// Code of the highest dc link that the power stage stands in operation. A code, so that no scale lifts it.
    pub dc_link_highest: u16,
    /// Largest code of the current channels.
    pub full_scale: u16,
    /// Thermistor of the heat sink.
    pub ntc: Ntc,
    /// Delay of the analog filters of the currents, s.
    pub current_delay_s: f32,
    /// Encoder counts per mechanical turn, four a line.
    pub encoder_counts: u32,
}

impl Default for Scales {
    /// Eq. 3.5; 0.11 V per code (451 V at full scale); the 5305 Hz filter of Figure 16; 2500 lines.
    fn default() -> Self {
        Self {
            current_a: Line::CHANNEL_A,
            current_b: Line::CHANNEL_B,
            current_c: Line::CHANNEL_B,
            sensors: CurrentSensors::InLine,
            shunt_settle_s: 2e-6,
            dc_link: Line { gain: 0.11, offset: 0.0 },
            dc_link_highest: 4095,
            full_scale: 4095,
            ntc: Ntc::default(),
            current_delay_s: 30e-6,
            encoder_counts: 10_000,
        }
    }
}
