//! The current sensors and the ADC.
//!
//! Section 3.2: two phases are measured, each through an analog first-order filter (Eq. 3.3), and converted to ADC
//! counts along the line of Eq. 3.5.

use std::f64::consts::TAU;

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::complex::{Complex, phases};
use crate::error::PlantError;

mod rare;
mod settings;

pub use settings::{CalibrationLine, MeasurementSettings};

use rare::{CurrentErrors, VoltageErrors};
use settings::FULL_SCALE;

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
    /// The ADC counts do not change.
    Stuck(u16),
    /// The sensor reads no current (noise and offset remain).
    Open,
    /// The ADC reads its largest value.
    SaturatedHigh,
    /// The ADC reads zero.
    SaturatedLow,
}

/// One channel, from current to ADC counts.
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

/// Returns the pole of a first-order lag, and the weights of its old and new input, over a step of `x` time constants
/// in which the input is a straight line.
#[inline]
fn coefficients(x: f64) -> [f64; 3] {
    let pole = (-x).exp();
    // Mean of the impulse response over the step.
    let mean = -(-x).exp_m1() / x;
    [pole, mean - pole, 1.0 - mean]
}

/// The two current sensors with their filters and ADCs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensors {
    noise: f64,
    channels: [CurrentChannel; 2],
    corner: f64,
    filtered: Complex,
    /// Rare errors; none if all of them are zero.
    rare: Option<CurrentErrors>,
    rare_dc: Option<VoltageErrors>,
    /// Coefficients of the filter, and the time step, s, for which they hold.
    step: f64,
    pole: f64,
    from_old: f64,
    from_new: f64,
    codes_per_v: f64,
    heat_sink: u16,
}

impl Sensors {
    /// Makes the sensors with these settings, at zero current.
    ///
    /// # Errors
    /// [`PlantError`].
    pub fn new(s: &MeasurementSettings) -> Result<Self, PlantError> {
        s.check()?;
        let [a, b] = s.calibration();
        Ok(Self {
            noise: s.noise_a,
            channels: [
                CurrentChannel::new(&a, s.gain_error_a, s.offset_a),
                CurrentChannel::new(&b, s.gain_error_b, s.offset_b),
            ],
            corner: TAU * s.filter_hz,
            filtered: Complex::ZERO,
            rare: CurrentErrors::new(s),
            rare_dc: VoltageErrors::new(s),
            step: f64::NAN,
            pole: 0.0,
            from_old: 0.0,
            from_new: 1.0,
            codes_per_v: 1.0 / s.dc_link_v,
            heat_sink: s.heat_sink_code,
        })
    }

    /// Begins a period of `period` seconds with this number of pulses.
    #[inline]
    pub(crate) fn begin_period(&mut self, period: f64, pulses: u16) {
        if let Some(rare) = &mut self.rare {
            rare.begin(period, pulses);
        }
    }

    /// Follows the current over `h` seconds, in which it changes linearly from `old` to `new`. Both channels have the
    /// same filter, so the space vector is filtered.
    #[inline]
    pub fn follow(&mut self, old: Complex, new: Complex, h: f64) {
        if h != self.step {
            self.prepare(h);
        }
        self.filtered = self.filtered * self.pole + old * self.from_old + new * self.from_new;
        if let Some(rare) = &mut self.rare {
            let [a, b, _] = phases(self.filtered);
            rare.follow([a, b], h);
        }
    }

    #[cold]
    fn prepare(&mut self, h: f64) {
        self.step = h;
        if let Some(rare) = &mut self.rare {
            rare.prepare(h);
        }
        if self.corner > 0.0 {
            [self.pole, self.from_old, self.from_new] = coefficients(self.corner * h);
        }
    }

    /// Changes the settings, and keeps current, faults and heat sink.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn set(&mut self, s: &MeasurementSettings) -> Result<(), PlantError> {
        let mut new = Self::new(s)?;
        (new.filtered, new.heat_sink) = (self.filtered, self.heat_sink);
        for (new, old) in new.channels.iter_mut().zip(&self.channels) {
            new.fault = old.fault;
        }
        if let Some(rare) = &mut new.rare {
            let [a, b, _] = phases(new.filtered);
            rare.rest([a, b]);
        }
        *self = new;
        Ok(())
    }

    /// Sets the fault of a channel.
    pub fn set_fault(&mut self, channel: Channel, fault: CurrentFault) {
        self.channels[channel as usize].fault = fault;
    }

    /// Returns the present ADC counts of channels A and B.
    #[inline]
    pub fn currents(&self, rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let Some(rare) = &self.rare else {
            let [a, b, _] = phases(self.filtered);
            return self.converted([a, b], [0.0; 2], rng);
        };
        self.rare_codes(rare, rng)
    }

    /// Returns ADC counts with the rare errors; with two conversions, their sum.
    #[cold]
    fn rare_codes(&self, rare: &CurrentErrors, rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let (now, middle) = rare.currents();
        let now = self.converted(now, rare.offsets(), rng);
        let Some(middle) = middle else { return now };
        let middle = self.converted(middle, rare.offsets(), rng);
        [0, 1].map(|k| now[k] + middle[k])
    }

    /// Converts these currents with further offsets, A, to ADC counts.
    #[inline]
    fn converted(&self, i: [f64; 2], offsets: [f64; 2], rng: &mut Xoshiro256PlusPlus) -> [u16; 2] {
        let code = |k: usize, noise: f64| self.channels[k].code(i[k], noise + offsets[k]);
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

    /// Follows the dc-link voltage, V, over `h` seconds; `vdc` is the voltage at their end.
    #[inline]
    pub(crate) fn follow_dc_link(&mut self, vdc: f64, h: f64) {
        if let Some(rare) = &mut self.rare_dc {
            rare.follow(vdc, h);
        }
    }

    /// Converts the dc-link voltage `vdc`, V, to ADC counts.
    #[inline]
    pub fn dc_link(&self, vdc: f64, rng: &mut Xoshiro256PlusPlus) -> u16 {
        let seen = self.rare_dc.as_ref().map_or(vdc, |rare| rare.reading(vdc, rng));
        ((seen * self.codes_per_v).clamp(0.0, FULL_SCALE) + 0.5) as u16
    }

    /// Returns the ADC counts of the heat-sink temperature.
    pub fn heat_sink(&self) -> u16 {
        self.heat_sink
    }

    /// Changes the ADC counts of the heat-sink temperature.
    pub fn set_heat_sink(&mut self, code: u16) {
        self.heat_sink = code;
    }
}
