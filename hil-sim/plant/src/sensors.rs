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
    /// Share of the current of phase b that channel A reads as well.
    pub cross_talk_a: f64,
    /// Share of the current of phase a that channel B reads as well.
    pub cross_talk_b: f64,
    /// Further lag of channel B, first order, us.
    pub lag_b_us: f64,
    /// Relative error at the end of the range that grows with the square of the current.
    pub cubic_error: f64,
    /// Drift of the offset of channel A from the start on, A/s.
    pub drift_a: f64,
    /// Drift of the offset of channel B, A/s.
    pub drift_b: f64,
    /// Whether each sample is the mean of two conversions, in the middle of the period and at its end: in both zero
    /// vectors.
    pub both_zero_vectors: bool,
    /// Dc-link voltage per code, V (12 bits).
    pub dc_link_v: f64,
    /// Relative gain error of the dc-link voltage.
    pub dc_gain_error: f64,
    /// Lag of the dc-link voltage, first order, us.
    pub dc_lag_us: f64,
    /// Gaussian noise of the dc-link voltage, V rms.
    pub dc_noise_v: f64,
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
        cross_talk_a: 0.0,
        cross_talk_b: 0.0,
        lag_b_us: 0.0,
        cubic_error: 0.0,
        drift_a: 0.0,
        drift_b: 0.0,
        both_zero_vectors: false,
        dc_link_v: 0.11,
        dc_gain_error: 0.0,
        dc_lag_us: 0.0,
        dc_noise_v: 0.0,
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
    /// 1/A^2.
    cubic: f64,
    /// A/s.
    drift: f64,
    codes_per_a: f64,
    zero: f64,
    full_scale: f64,
    fault: CurrentFault,
}

impl CurrentChannel {
    fn new(line: &CalibrationLine, gain_error: f64, offset: f64, cubic: f64, drift: f64) -> Self {
        Self {
            gain: 1.0 + gain_error,
            offset,
            cubic: cubic / (line.a_at_zero * line.a_at_zero),
            drift,
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
        let bent = if self.cubic == 0.0 { current } else { current + self.cubic * current.powi(3) };
        let measured = bent * self.gain + self.offset + noise;
        let code = (measured - self.zero) * self.codes_per_a;
        // Rounds half up; the cast of a number that is not negative rounds down.
        (code.clamp(0.0, self.full_scale) + 0.5) as u16
    }
}

/// Pole, and weights of old and new input, of a first-order lag over a step of `x` time constants in which
/// the input is straight.
fn coefficients(x: f64) -> [f64; 3] {
    let pole = (-x).exp();
    // Mean of the impulse response over the step.
    let mean = -(-x).exp_m1() / x;
    [pole, mean - pole, 1.0 - mean]
}

/// The two current sensors with their filters and converters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    noise: f64,
    channels: [CurrentChannel; 2],
    corner: f64,
    filtered: Complex,
    /// Channel B behind its own lag, if it has one.
    lagged_b: f64,
    lag_b: f64,
    before_b: f64,
    lagging_b: [f64; 3],
    /// Shares of the other phase.
    cross_talk: [f64; 2],
    /// What the channels see in the middle of the period, if that is converted too.
    both: bool,
    middle: [f64; 2],
    /// Seconds from the start.
    time: f64,
    dc_gain: f64,
    dc_lag: f64,
    dc_seen: f64,
    dc_noise: f64,
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
        check("measurement.cross_talk_a", s.cross_talk_a, -0.2..=0.2, "")?;
        check("measurement.cross_talk_b", s.cross_talk_b, -0.2..=0.2, "")?;
        check("measurement.lag_b_us", s.lag_b_us, 0.0..=1000.0, "us")?;
        check("measurement.cubic_error", s.cubic_error, -0.3..=0.3, "")?;
        check("measurement.drift_a", s.drift_a, -1.0..=1.0, "A/s")?;
        check("measurement.drift_b", s.drift_b, -1.0..=1.0, "A/s")?;
        check("measurement.dc_link_v", s.dc_link_v, 0.001..=10.0, "V")?;
        check("measurement.dc_gain_error", s.dc_gain_error, -0.5..=0.5, "")?;
        check("measurement.dc_lag_us", s.dc_lag_us, 0.0..=1e5, "us")?;
        check("measurement.dc_noise_v", s.dc_noise_v, 0.0..=100.0, "V")?;
        let [a, b] = s.calibration();
        Ok(Self {
            noise: s.noise_a,
            channels: [
                CurrentChannel::new(&a, s.gain_error_a, s.offset_a, s.cubic_error, s.drift_a),
                CurrentChannel::new(&b, s.gain_error_b, s.offset_b, s.cubic_error, s.drift_b),
            ],
            corner: TAU * s.filter_hz,
            filtered: Complex::ZERO,
            lagged_b: 0.0,
            lag_b: s.lag_b_us * 1e-6,
            before_b: 0.0,
            lagging_b: [0.0; 3],
            cross_talk: [s.cross_talk_a, s.cross_talk_b],
            both: s.both_zero_vectors,
            middle: [0.0; 2],
            time: 0.0,
            dc_gain: 1.0 + s.dc_gain_error,
            dc_lag: s.dc_lag_us * 1e-6,
            dc_seen: f64::NAN,
            dc_noise: s.dc_noise_v,
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
        self.time += h;
        if self.lag_b > 0.0 {
            let b = phases(self.filtered)[1];
            let [pole, from_old, from_new] = self.lagging_b;
            self.lagged_b = self.lagged_b * pole + self.before_b * from_old + b * from_new;
            self.before_b = b;
        }
    }

    /// What the channels see now, without their own errors.
    #[inline]
    fn seen(&self) -> [f64; 2] {
        let [a, b, _] = phases(self.filtered);
        let b = if self.lag_b > 0.0 { self.lagged_b } else { b };
        [a + self.cross_talk[0] * b, b + self.cross_talk[1] * a]
    }

    /// Holds the currents of the middle of the period for the sample at its end.
    #[inline]
    pub(crate) fn hold_middle(&mut self) {
        if self.both {
            self.middle = self.seen();
        }
    }

    #[cold]
    fn prepare(&mut self, h: f64) {
        self.step = h;
        if self.lag_b > 0.0 {
            self.lagging_b = coefficients(h / self.lag_b);
        }
        if self.corner > 0.0 {
            [self.pole, self.from_old, self.from_new] = coefficients(self.corner * h);
        }
    }

    /// Sets the fault of a channel.
    pub fn set_fault(&mut self, channel: Channel, fault: CurrentFault) {
        self.channels[channel as usize].fault = fault;
    }

    /// The codes of channels A and B now.
    #[inline]
    pub fn currents(&self, rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let now = self.converted(self.seen(), rng);
        if !self.both {
            return now;
        }
        let middle = self.converted(self.middle, rng);
        [0, 1].map(|k| (u32::from(now[k]) + u32::from(middle[k])).div_ceil(2) as u16)
    }

    #[inline]
    fn converted(&self, seen: [f64; 2], rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let code = |k: usize, noise: f64| {
            let channel = &self.channels[k];
            channel.code(seen[k], noise + channel.drift * self.time)
        };
        if self.noise == 0.0 {
            return [code(0, 0.0), code(1, 0.0)];
        }
        let mut noise = || -> f64 {
            let unit: f64 = StandardNormal.sample(rng);
            unit * self.noise
        };
        let (a, b) = (noise(), noise());
        [code(0, a), code(1, b)]
    }

    /// Follows the dc-link voltage, V, over `h` seconds at whose end it is `vdc`.
    #[inline]
    pub(crate) fn follow_dc_link(&mut self, vdc: f64, h: f64) {
        if self.dc_lag > 0.0 {
            let before = if self.dc_seen.is_nan() { vdc } else { self.dc_seen };
            self.dc_seen = vdc + (before - vdc) * (-h / self.dc_lag).exp();
        }
    }

    /// The code of the dc-link voltage, which is `vdc`, V.
    #[inline]
    pub fn dc_link(&self, vdc: f64, rng: &mut Xoshiro256PlusPlus) -> u16 {
        let lags = self.dc_lag > 0.0 && !self.dc_seen.is_nan();
        let mut seen = self.dc_gain * if lags { self.dc_seen } else { vdc };
        if self.dc_noise > 0.0 {
            let unit: f64 = StandardNormal.sample(rng);
            seen += unit * self.dc_noise;
        }
        ((seen * self.codes_per_v).clamp(0.0, FULL_SCALE) + 0.5) as u16
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
