//! The injected voltage, Eq. 3.6: `v_hf cos(Omega t)` along the injection axis `theta = phi + 90°`, with
//! `Omega / 2 pi` = f_s / 10 (600 Hz at 6 kHz).
//!
//! The fundamental may leave too little voltage for the full amplitude. [`Carrier::fit`] then reduces the
//! carrier to a `share` of it, and reports when less than half would remain.

use crate::{Dq, Fault, FirstOrder, PERIOD_S};
use num_complex::{Complex32, Complex64};

/// Samples per period of the carrier.
pub const CARRIER_SAMPLES: usize = 10;
/// Period of the carrier, s.
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

/// Half of the change of a sine over a PWM period, per mean of the sine a quarter ahead of it: the tangent of 18 degrees.
const HALF_CHANGE: f32 = 0.324_919_7;

/// Coefficients of the injection: the carrier's voltage and the currents that it makes, as phasors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Injection {
    /// Amplitude of the voltage, V peak.
    pub amplitude: f32,
    /// Amplitude of the carrier current along the injection axis at full voltage, A peak.
    pub current_amplitude: f32,
    /// Mean of the carrier current over a period, and the current in the sample from which the period is computed, A.
    mean: Complex32,
    sampled: Complex32,
}

impl Injection {
    /// The carrier for an amplitude in V peak.
    ///
    /// `plant` is the current response of the motor, A/V, at the control rate (ten times the carrier
    /// frequency); `analog` the time constant of the analog current filter in samples.
    pub fn new(amplitude_v: f32, plant: FirstOrder, analog: f32) -> Self {
        // Steady-state response of i[n+1] = p i[n] + k v[n] to v[n] = V cos(2 pi n / 10): the current
        // at the start of period n is V k / (e^(j w) - p) e^(j w n). Its mean over the period equals
        // the mean of the samples at both ends to 0.1 %.
        let turn = Complex64 { re: 0.809_016_994_374_947_5, im: 0.587_785_252_292_473_1 };
        let response = Complex64 { re: plant.k, im: 0.0 } / (turn - plant.p);
        // The voltage computed in step k acts from sample k + 1 on: sample k shows the response to
        // period k - 1, H e^(-j w), behind the analog filter 1 / (1 + j w tau).
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

/// State of the carrier: position in its period, and share of the amplitude in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    index: usize,
    /// Share of the full amplitude in use; lower where the fundamental leaves too little voltage, above 1 only without a current.
    pub share: f32,
    /// 1 / `share`^2.
    pub per_share_squared: f32,
    /// Carrier periods since the share changed.
    unchanged: u8,
}

impl Default for Carrier {
    /// At the beginning of a carrier period, full amplitude.
    fn default() -> Self {
        Self { index: 0, share: 1.0, per_share_squared: 1.0, unchanged: u8::MAX }
    }
}

/// Decrease of the share per carrier period. Fast: a voltage outside the hexagon is shortened, which
/// rotates the carrier.
const SHARE_DOWN: f32 = 1.0 / 16.0;
/// Increase of the share per carrier period.
const SHARE_UP: f32 = 1.0 / 64.0;
/// Headroom required before the share is increased, as a share; it prevents hunting.
const SHARE_MARGIN: f32 = 0.125;
/// Minimum share: noise causes twice the angle error there.
const LEAST_SHARE: f32 = 0.5;
/// Carrier periods until a change of the share has left the demodulation: 40 samples.
const FORGOTTEN: u8 = 4;

/// The carrier in one PWM period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CarrierPeriod {
    /// Voltage along the injection axis, V.
    pub voltage: f32,
    /// Expected mean of the carrier current along the injection axis over the period, A.
    pub mean_current: f32,
    /// Half of the expected change of the carrier current from the beginning of the period to its end, A.
    pub half_change: f32,
    /// Expected carrier current along the injection axis in the sample from which this period is
    /// computed, A.
    pub sampled: f32,
    /// Cosine of the carrier phase.
    pub cos: f32,
    /// Sine of the carrier phase.
    pub sin: f32,
}

impl Carrier {
    /// Adapts the share to the voltage that the `fundamental`, V peak, leaves; called once per carrier
    /// period. `largest` is the largest vector that the inverter realises in every direction, V peak.
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

    /// Sets the share; from above 1 it falls until it fits, and does not rise.
    pub fn set(&mut self, share: f32) {
        (self.share, self.per_share_squared, self.unchanged) = (share, 1.0 / (share * share), 0);
    }

    /// Whether the demodulation averages contain the present share only.
    pub fn is_settled(&self) -> bool {
        self.unchanged > FORGOTTEN
    }

    /// Advances to the next PWM period and returns its index in the carrier period, 0 to 9. It counts
    /// with or without a carrier.
    pub fn advance(&mut self) -> usize {
        // Always below ten; the test guards against a flipped bit.
        let index = if self.index < CARRIER_SAMPLES { self.index } else { 0 };
        self.index = index + 1;
        index
    }

    /// Whether PWM period `index` of the carrier period was the last one.
    pub fn is_behind(&self, index: usize) -> bool {
        self.index == index + 1
    }

    /// The carrier in PWM period `index`.
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
        // Motor of Table 5 (R' = 6.22 ohm, sigma L_s = 51.5 mH), 50 V: 0.26 A (notes: 50 / 194).
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
        // Ten samples a period reach the peak to within 5 %.
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

    /// 50 V beside 100 V: down by sixteenths to what fits, up by a 64th where an eighth more fits.
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
