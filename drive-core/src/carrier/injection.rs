//! The injected voltage, Eq. 3.6: `v_hf cos(Omega t)` along the injection axis `theta = phi + 90°`, with
//! `Omega / 2 pi` = f_s / 10 (600 Hz at 6 kHz).
//!
//! The fundamental may leave too little voltage for the full amplitude. [`Carrier::fit`] then reduces the
//! injected voltage to a `share` of that amplitude, and reports when less than half would remain.

use crate::{Dq, Fault, FirstOrder, PERIOD_S};
use num_complex::{Complex32, Complex64};

/// Samples per injection period.
pub const CARRIER_SAMPLES: usize = 10;
/// Injection period, s.
pub const CARRIER_S: f32 = CARRIER_SAMPLES as f32 * PERIOD_S;

/// `cos(2 pi k / 10)`.
pub const CARRIER_COS: [f32; CARRIER_SAMPLES] = [
    1.0, 0.809_017, 0.309_017, -0.309_017, -0.809_017, -1.0, -0.809_017, -0.309_017, 0.309_017,
    0.809_017,
];

/// `sin(2 pi k / 10)`.
#[rustfmt::skip]
pub const CARRIER_SIN: [f32; CARRIER_SAMPLES] = [
    0.0, 0.587_785_24, 0.951_056_5, 0.951_056_5, 0.587_785_24,
    0.0, -0.587_785_24, -0.951_056_5, -0.951_056_5, -0.587_785_24,
];

/// Half of the change of a sine over a PWM period, relative to the mean of the sine that is a quarter period ahead: the tangent of
/// 18 degrees.
const HALF_CHANGE: f32 = 0.324_919_7;

/// Coefficients of the injection: the injected voltage and the currents that it causes, as phasors.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Injection {
    /// Amplitude of the voltage, V peak.
    pub amplitude: f32,
    /// Amplitude of the injection current along the injection axis at full voltage, A peak.
    pub current_amplitude: f32,
    /// Mean of the injection current over a period, and its value in the sample from which the period is computed, A.
    mean: Complex32,
    sampled: Complex32,
}

impl Injection {
    /// Creates the injection with an amplitude in V peak.
    ///
    /// `plant` is the current response of the motor, A/V, at the control rate (ten times the
    /// injection frequency); `analog` is the time constant of the analog current filter in samples.
    pub fn new(amplitude_v: f32, plant: FirstOrder, analog: f32) -> Self {
        // The steady-state response of i[n+1] = p i[n] + k v[n] to v[n] = V cos(2 pi n / 10): the
        // current at the start of period n is V k / (e^(j w) - p) e^(j w n). Its mean over the period
        // equals the mean of the samples at both ends to 0.1 %.
        let turn = Complex64 { re: 0.809_016_994_374_947_5, im: 0.587_785_252_292_473_1 };
        let response = Complex64 { re: plant.k, im: 0.0 } / (turn - plant.p);
        // The voltage computed in step k acts from sample k + 1 on. Sample k shows the response to
        // period k - 1, H e^(-j w), after the analog filter 1 / (1 + j w tau).
        let w = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
        let sampled = response / (turn * Complex64 { re: 1.0, im: w * f64::from(analog) });
        let phasor = |z: Complex64| Complex32::new(z.re as f32, z.im as f32) * amplitude_v;
        Self {
            amplitude: amplitude_v,
            current_amplitude: response.norm() as f32 * amplitude_v,
            mean: phasor(response * (turn + 1.0) * 0.5),
            sampled: phasor(sampled),
        }
    }
}

/// State of the injection: position in its period, and share of the amplitude in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    index: usize,
    /// Share of the full amplitude in use. It is lower if the fundamental leaves too little voltage, and above 1 only without a
    /// fundamental current.
    pub share: f32,
    /// 1 / `share`^2.
    pub per_share_squared: f32,
    /// Injection periods since the share changed.
    unchanged: u8,
}

impl Default for Carrier {
    /// Begins an injection period with full amplitude.
    fn default() -> Self {
        Self { index: 0, share: 1.0, per_share_squared: 1.0, unchanged: u8::MAX }
    }
}

/// Decrease of the share per injection period. It is fast, because a voltage outside the hexagon is
/// shortened, which rotates the injected voltage.
const SHARE_DOWN: f32 = 1.0 / 16.0;
/// Increase of the share per injection period.
const SHARE_UP: f32 = 1.0 / 64.0;
/// Headroom required before the share is increased, as a share of the amplitude; it prevents hunting.
const SHARE_MARGIN: f32 = 0.125;
/// Minimum share, at which noise causes twice the angle error.
const LEAST_SHARE: f32 = 0.5;
/// Injection periods until a change of the share has left the demodulation: 40 samples.
const FORGOTTEN: u8 = 4;

/// The injection in one PWM period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CarrierPeriod {
    /// Voltage along the injection axis, V.
    pub voltage: f32,
    /// Expected mean of the injection current along the injection axis over the period, A.
    pub mean_current: f32,
    /// Half of the expected change of the injection current from the beginning of the period to its end, A.
    pub half_change: f32,
    /// Expected injection current along the injection axis in the sample from which this period is
    /// computed, A.
    pub sampled: f32,
    /// Cosine of the phase of the injection.
    pub cos: f32,
    /// Sine of the phase of the injection.
    pub sin: f32,
}

impl Carrier {
    /// Adapts the share to the voltage that the `fundamental`, V peak, leaves; called once per
    /// injection period. `largest` is the largest vector that the inverter realises in every
    /// direction, V peak.
    ///
    /// # Errors
    /// [`Fault::CarrierNoRoom`] when less than half of the amplitude fits.
    pub fn fit(
        &mut self,
        injection: &Injection,
        fundamental: Dq,
        largest: f32,
    ) -> Result<(), Fault> {
        let at_most_all = |share: f32| if share < 1.0 { share } else { 1.0 };
        let used = fundamental.length_squared();
        let fits = |share: f32| {
            let room = largest - share * injection.amplitude;
            room > 0.0 && used <= room * room
        };
        let share = if !fits(self.share) {
            self.share - SHARE_DOWN
        } else if self.share < 1.0 && fits(at_most_all(self.share + SHARE_MARGIN)) {
            at_most_all(self.share + SHARE_UP)
        } else {
            self.share
        };
        if share == self.share {
            self.unchanged = self.unchanged.saturating_add(1);
        } else {
            self.set(share);
        }
        Fault::CarrierNoRoom.unless(share >= LEAST_SHARE)
    }

    /// Sets the share. A share above 1 falls until it fits, and does not rise.
    pub fn set(&mut self, share: f32) {
        (self.share, self.per_share_squared, self.unchanged) = (share, 1.0 / (share * share), 0);
    }

    /// Whether the demodulation averages contain the present share only.
    pub fn is_settled(&self) -> bool {
        self.unchanged > FORGOTTEN
    }

    /// Advances to the next PWM period and returns its index in the injection period, 0 to 9. It
    /// counts with or without an injection.
    pub fn advance(&mut self) -> usize {
        // The index is always below ten; the comparison guards against a flipped bit.
        let index = if self.index < CARRIER_SAMPLES { self.index } else { 0 };
        self.index = index + 1;
        index
    }

    /// Whether PWM period `index` of the injection period was the last one.
    pub fn is_behind(&self, index: usize) -> bool {
        self.index == index + 1
    }

    /// Returns the injection in PWM period `index`.
    pub fn at(&self, injection: &Injection, index: usize) -> CarrierPeriod {
        let index = if index < CARRIER_SAMPLES { index } else { 0 };
        let turn = Complex32 { re: CARRIER_COS[index], im: CARRIER_SIN[index] };
        let (mean, sampled) = (injection.mean * turn, injection.sampled * turn);
        CarrierPeriod {
            voltage: self.share * injection.amplitude * turn.re,
            mean_current: self.share * mean.re,
            half_change: self.share * -HALF_CHANGE * mean.im,
            sampled: self.share * sampled.re,
            cos: turn.re,
            sin: turn.im,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;

    #[test]
    fn the_tables_are_ten_samples_of_a_turn() {
        for k in 0..CARRIER_SAMPLES {
            let x = core::f64::consts::TAU * k as f64 / 10.0;
            assert!((f64::from(CARRIER_COS[k]) - x.cos()).abs() < 6e-8);
            assert!((f64::from(CARRIER_SIN[k]) - x.sin()).abs() < 6e-8);
        }
    }

    #[test]
    fn expected_current_is_the_simulated_one() {
        // For the motor of Table 5 (R' = 6.22 ohm, sigma L_s = 51.5 mH), 50 V cause 0.26 A (50 / 194).
        let plant = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
        let injection = Injection::new(50.0, plant, 0.0);
        let mut carrier = Carrier::default();
        let (mut i, mut peak) = (0.0_f64, 0.0_f64);
        for n in 0..6000 {
            let index = carrier.advance();
            let now = carrier.at(&injection, index);
            // `i` is the current at the start of the period in which the voltage acts, one sample
            // after the one it was computed from.
            let next = plant.p * i + plant.k * f64::from(now.voltage);
            if n > 5000 {
                assert!((0.5 * (i + next) - f64::from(now.mean_current)).abs() < 1e-5);
                assert!((0.5 * (next - i) - f64::from(now.half_change)).abs() < 1e-5);
                let one_later = carrier.at(&injection, (index + 1) % CARRIER_SAMPLES).sampled;
                assert!((i - f64::from(one_later)).abs() < 1e-5);
                peak = peak.max(next.abs());
            }
            i = next;
        }
        // With ten samples a period, one is within 5 % of the peak.
        let ratio = peak / f64::from(injection.current_amplitude);
        assert!((0.95..=1.0001).contains(&ratio), "{ratio}");
        assert!((injection.current_amplitude - 0.26).abs() < 0.01);
    }

    #[test]
    fn a_smaller_carrier_is_smaller_in_voltage_and_current() {
        let injection = Injection::new(50.0, FirstOrder { k: 0.003_205_2, p: 0.980_053 }, 0.18);
        let [whole, part] = [1.0, 0.6].map(|share| Carrier { share, ..Carrier::default() });
        for index in 0..CARRIER_SAMPLES {
            let (whole, part) = (whole.at(&injection, index), part.at(&injection, index));
            for (part, whole) in [
                (part.voltage, whole.voltage),
                (part.mean_current, whole.mean_current),
                (part.half_change, whole.half_change),
                (part.sampled, whole.sampled),
            ] {
                assert!((part - 0.6 * whole).abs() < 1e-5 * whole.abs(), "{part} {whole}");
            }
            assert_eq!((part.cos, part.sin), (whole.cos, whole.sin));
        }
    }

    /// 50 V are injected beside 100 V. The share falls by sixteenths to the share that fits, and rises by a 64th if an eighth more
    /// fits.
    #[test]
    fn the_share_is_what_fits() {
        let injection = Injection::new(50.0, FirstOrder { k: 0.003_205_2, p: 0.980_053 }, 0.0);
        let mut carrier = Carrier::default();
        let mut settled = |largest: f32| {
            let result = (0..200).map(|_| carrier.fit(&injection, Dq::new(60.0, 80.0), largest));
            let result = result.collect::<Vec<_>>();
            let squared = carrier.share * carrier.share;
            assert!((carrier.per_share_squared * squared - 1.0).abs() < 1e-6);
            assert!(carrier.is_settled() || result.last() == Some(&Err(Fault::CarrierNoRoom)));
            (carrier.share, result.contains(&Err(Fault::CarrierNoRoom)))
        };
        assert_eq!(settled(150.0), (1.0, false));
        assert_eq!(settled(140.0), (0.75, false));
        assert_eq!(settled(144.0), (0.765_625, false));
        assert_eq!(settled(160.0), (1.0, false));
        assert!(settled(124.0).1);
    }
}
