//! The current sensors and the converter.
//!
//! Section 3.2: two phases are measured, each through an analog first-order filter (Eq. 3.3), and
//! converted to a code along the line of Eq. 3.5.

use std::f64::consts::TAU;

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::{Deserialize, Serialize};

use crate::complex::{Complex, phases};
use crate::error::{PlantError, check};

/// Eq. 3.5, channel A and B: A per code, and the current of code zero in A.
const CALIBRATION: [(f64, f64); 2] = [(0.002_212_0, -4.472_713_4), (0.002_231_4, -4.496_623_8)];
/// Largest code of the source's converter.
const FULL_SCALE: f64 = 4095.0;

/// Errors of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasurementSettings {
    /// Gaussian noise of each current channel, A rms.
    pub noise_a: f64,
    /// End of the range of channel A, A; B in proportion.
    pub range_a: f64,
    /// Current per code of channel A, A; B in proportion. A finer converter has more codes over the
    /// same range, up to 16 bits.
    pub lsb_a: f64,
    /// Corner of the analog filter, Hz (Eq. 3.3); 0 is none.
    pub filter_hz: f64,
    /// Relative gain error of channel A.
    pub gain_error_a: f64,
    /// Relative gain error of channel B.
    pub gain_error_b: f64,
    /// Offset of channel A, A.
    pub offset_a: f64,
    /// Offset of channel B, A.
    pub offset_b: f64,
    /// Dc-link voltage per code, V (12 bits).
    pub dc_link_v: f64,
    /// Code of the heat-sink temperature.
    pub heat_sink_code: u16,
}

impl Default for MeasurementSettings {
    fn default() -> Self {
        Self::REFERENCE
    }
}

impl MeasurementSettings {
    /// The measurement of the reference board.
    const REFERENCE: Self = Self {
        noise_a: 0.005,
        range_a: -CALIBRATION[0].1,
        lsb_a: CALIBRATION[0].0,
        filter_hz: 5305.0,
        gain_error_a: 0.0,
        gain_error_b: 0.0,
        offset_a: 0.0,
        offset_b: 0.0,
        dc_link_v: 0.11,
        heat_sink_code: 1309,
    };

    /// No noise, no filter, 16 bits.
    pub const IDEAL: Self =
        Self { noise_a: 0.0, lsb_a: 0.000_14, filter_hz: 0.0, ..Self::REFERENCE };

    /// The calibration of channels A and B without their gain and offset errors, as the drive is set.
    pub fn calibration(&self) -> [CalibrationLine; 2] {
        let wider = self.range_a / -CALIBRATION[0].1;
        let finer = wider * CALIBRATION[0].0 / self.lsb_a;
        CALIBRATION.map(|(a_per_code, a_at_zero)| CalibrationLine {
            a_per_code: wider * a_per_code / finer,
            a_at_zero: wider * a_at_zero,
            full_scale: (FULL_SCALE * finer).round() as u16,
        })
    }
}

/// Line of one current channel: `I = a_per_code n + a_at_zero`, Eq. 3.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationLine {
    /// Current per code, A.
    pub a_per_code: f64,
    /// Current at code zero, A.
    pub a_at_zero: f64,
    /// Largest code.
    pub full_scale: u16,
}

/// One of the two measured phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Phase a.
    A,
    /// Phase b.
    B,
}

/// Fault of a current channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurrentFault {
    /// No fault.
    #[default]
    None,
    /// The code does not change.
    Stuck(u16),
    /// The sensor reads no current (noise and offset stay).
    Open,
    /// The largest code.
    SaturatedHigh,
    /// Code zero.
    SaturatedLow,
}

/// One channel, current to code.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CurrentChannel {
    gain: f64,
    offset: f64,
    codes_per_a: f64,
    zero: f64,
    full_scale: f64,
    fault: CurrentFault,
}

impl CurrentChannel {
    fn new(line: &CalibrationLine, gain_error: f64, offset: f64) -> Self {
        Self {
            gain: 1.0 + gain_error,
            offset,
            codes_per_a: 1.0 / line.a_per_code,
            zero: line.a_at_zero,
            full_scale: f64::from(line.full_scale),
            fault: CurrentFault::None,
        }
    }

    #[inline]
    fn code(&self, current: f64, noise: f64) -> u16 {
        let current = match self.fault {
            CurrentFault::None => current,
            CurrentFault::Open => 0.0,
            CurrentFault::Stuck(code) => return code.min(self.full_scale as u16),
            CurrentFault::SaturatedHigh => return self.full_scale as u16,
            CurrentFault::SaturatedLow => return 0,
        };
        let measured = current * self.gain + self.offset + noise;
        let code = (measured - self.zero) * self.codes_per_a;
        // Rounds half up; the cast of a number that is not negative rounds down.
        (code.clamp(0.0, self.full_scale) + 0.5) as u16
    }
}

/// The two current sensors with their filters and converters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    noise: f64,
    channels: [CurrentChannel; 2],
    corner: f64,
    filtered: Complex,
    /// Coefficients of the filter and the time step, s, they are for.
    step: f64,
    pole: f64,
    from_old: f64,
    from_new: f64,
    codes_per_v: f64,
    heat_sink: u16,
}

impl Sensors {
    /// The sensors with these settings, at zero current.
    ///
    /// # Errors
    /// [`PlantError::OutOfRange`].
    pub fn new(s: &MeasurementSettings) -> Result<Self, PlantError> {
        check("measurement.noise_a", s.noise_a, 0.0..=10.0, "A")?;
        check("measurement.range_a", s.range_a, 0.01..=5000.0, "A")?;
        // 7 to 16 bits.
        check("measurement.lsb_a", s.lsb_a, s.range_a / 32_000.0..=s.range_a / 80.0, "A")?;
        check("measurement.filter_hz", s.filter_hz, 0.0..=1e6, "Hz")?;
        check("measurement.gain_error_a", s.gain_error_a, -0.5..=0.5, "")?;
        check("measurement.gain_error_b", s.gain_error_b, -0.5..=0.5, "")?;
        check("measurement.offset_a", s.offset_a, -5.0..=5.0, "A")?;
        check("measurement.offset_b", s.offset_b, -5.0..=5.0, "A")?;
        check("measurement.dc_link_v", s.dc_link_v, 0.001..=10.0, "V")?;
        let [a, b] = s.calibration();
        Ok(Self {
            noise: s.noise_a,
            channels: [
                CurrentChannel::new(&a, s.gain_error_a, s.offset_a),
                CurrentChannel::new(&b, s.gain_error_b, s.offset_b),
            ],
            corner: TAU * s.filter_hz,
            filtered: Complex::ZERO,
            step: f64::NAN,
            pole: 0.0,
            from_old: 0.0,
            from_new: 1.0,
            codes_per_v: 1.0 / s.dc_link_v,
            heat_sink: s.heat_sink_code,
        })
    }

    /// Follows the current over `h` seconds, in which it goes linearly from `old` to `new`. Both
    /// channels have the same filter, so it filters the space vector.
    #[inline]
    pub fn follow(&mut self, old: Complex, new: Complex, h: f64) {
        if h != self.step {
            self.prepare(h);
        }
        self.filtered = self.filtered * self.pole + old * self.from_old + new * self.from_new;
    }

    #[cold]
    fn prepare(&mut self, h: f64) {
        self.step = h;
        let x = self.corner * h;
        if x == 0.0 {
            return;
        }
        self.pole = (-x).exp();
        // Mean of the impulse response over the step.
        let mean = -(-x).exp_m1() / x;
        self.from_old = mean - self.pole;
        self.from_new = 1.0 - mean;
    }

    /// Sets the fault of a channel.
    pub fn set_fault(&mut self, channel: Channel, fault: CurrentFault) {
        self.channels[channel as usize].fault = fault;
    }

    /// The codes of channels A and B now.
    #[inline]
    pub fn currents(&self, rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let [a, b, _] = phases(self.filtered);
        if self.noise == 0.0 {
            return [self.channels[0].code(a, 0.0), self.channels[1].code(b, 0.0)];
        }
        let mut noise = || -> f64 {
            let unit: f64 = StandardNormal.sample(rng);
            unit * self.noise
        };
        [self.channels[0].code(a, noise()), self.channels[1].code(b, noise())]
    }

    /// The code of the dc-link voltage, V.
    #[inline]
    pub fn dc_link(&self, vdc: f64) -> u16 {
        ((vdc * self.codes_per_v).clamp(0.0, FULL_SCALE) + 0.5) as u16
    }

    /// The code of the heat-sink temperature.
    pub fn heat_sink(&self) -> u16 {
        self.heat_sink
    }

    /// Changes the code of the heat-sink temperature.
    pub fn set_heat_sink(&mut self, code: u16) {
        self.heat_sink = code;
    }
}
