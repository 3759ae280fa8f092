//! The injected voltage, Eq. 3.6: `v_hf cos(Omega t)` along `theta = phi + 90°`, with
//! `Omega / 2 pi` = f_s / 10 (600 Hz at 6 kHz).

use crate::angle::{Angle, UnitVector};
use crate::tuning::FirstOrder;

/// Samples per period of the carrier.
pub const CARRIER_SAMPLES: usize = 10;

/// `cos(2 pi k / 10)`.
pub const CARRIER_COS: [f32; CARRIER_SAMPLES] = [
    1.0, 0.809_017, 0.309_017, -0.309_017, -0.809_017, -1.0, -0.809_017, -0.309_017, 0.309_017,
    0.809_017,
];

/// `sin(2 pi k / 10)`.
pub const CARRIER_SIN: [f32; CARRIER_SAMPLES] = [
    0.0,
    0.587_785_24,
    0.951_056_5,
    0.951_056_5,
    0.587_785_24,
    0.0,
    -0.587_785_24,
    -0.951_056_5,
    -0.951_056_5,
    -0.587_785_24,
];

/// The injection axis seen from the flux, as an angle and as a unit vector of that angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InjectionAxis {
    /// The angle.
    pub turn: Angle,
    /// The same, for rotations.
    pub unit: UnitVector,
}

impl InjectionAxis {
    /// The quadrature axis, where the injection belongs.
    pub const QUADRATURE: Self =
        Self { turn: Angle::QUARTER, unit: UnitVector { cos: 0.0, sin: 1.0 } };

    /// Turned by an angle from the quadrature axis.
    pub fn turned(angle: Angle) -> Self {
        let turn = Angle::QUARTER + angle;
        Self { turn, unit: turn.unit_vector() }
    }
}

/// Coefficients of the injection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Injection {
    /// Voltage along the injection axis in period k of the carrier, V.
    voltage: [f32; CARRIER_SAMPLES],
    /// The current this voltage drives, averaged over the period in which it is applied, A.
    mean_current: [f32; CARRIER_SAMPLES],
    /// The current that is sampled while the voltage of period k is computed, A.
    sampled: [f32; CARRIER_SAMPLES],
    /// Amplitude of the sampled current, A.
    pub current_amplitude: f32,
}

impl Injection {
    /// For an amplitude in V, the current response of the motor, A/V, sampled at ten times the carrier
    /// frequency, and the time constant of the analog filter in samples.
    pub fn new(amplitude_v: f32, plant: FirstOrder, analog: f32) -> Self {
        // Steady response of i[n+1] = p i[n] + k v[n] to v[n] = V cos(2 pi n / 10): the current at
        // the start of period n is V k / (e^(j w) - p) e^(j w n); its mean over the period that of
        // the samples at both ends, to 0.1 %.
        let (c, s) = (0.809_016_994_374_947_5_f64, 0.587_785_252_292_473_1_f64);
        let (re, im) = (c - plant.p, s);
        let square = re * re + im * im;
        let (h_re, h_im) = (plant.k * re / square, -plant.k * im / square);
        // times (1 + e^(j w)) / 2
        let (a, b) = (0.5 * (1.0 + c), 0.5 * s);
        // What is computed in step k acts from the sample k + 1 on: at sample k the response is that
        // of period k - 1, H e^(-j w), behind the analog filter 1 / (1 + j w tau).
        let lag = core::f64::consts::TAU / CARRIER_SAMPLES as f64 * f64::from(analog);
        let (f_re, f_im) = (1.0 / (1.0 + lag * lag), -lag / (1.0 + lag * lag));
        let (d_re, d_im) = (c * f_re + s * f_im, c * f_im - s * f_re);
        let (s_re, s_im) = ((h_re * d_re - h_im * d_im) as f32, (h_re * d_im + h_im * d_re) as f32);
        let (m_re, m_im) = ((h_re * a - h_im * b) as f32, (h_re * b + h_im * a) as f32);
        Self {
            voltage: CARRIER_COS.map(|c| amplitude_v * c),
            mean_current: core::array::from_fn(|n| {
                amplitude_v * (m_re * CARRIER_COS[n] - m_im * CARRIER_SIN[n])
            }),
            sampled: core::array::from_fn(|n| {
                amplitude_v * (s_re * CARRIER_COS[n] - s_im * CARRIER_SIN[n])
            }),
            current_amplitude: (libm::sqrt(h_re * h_re + h_im * h_im)) as f32 * amplitude_v,
        }
    }
}

/// Where in its period the carrier is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Carrier {
    index: usize,
}

/// The carrier during one PWM period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CarrierPeriod {
    /// Voltage along the injection axis, V.
    pub voltage: f32,
    /// Mean current expected from it along the injection axis, A.
    pub mean_current: f32,
    /// Current expected from it in the sample from which this period is computed, A.
    pub sampled: f32,
    /// Its number in the carrier period, 0 to 9.
    pub index: usize,
}

impl Carrier {
    /// The next PWM period's share.
    pub fn step(&mut self, injection: &Injection) -> CarrierPeriod {
        // The index is below ten by construction; `% 10` keeps the compiler from a panic path and
        // a flipped bit from being one.
        let index = self.index % CARRIER_SAMPLES;
        self.index = if index == CARRIER_SAMPLES - 1 { 0 } else { index + 1 };
        CarrierPeriod {
            voltage: injection.voltage[index],
            mean_current: injection.mean_current[index],
            sampled: injection.sampled[index],
            index,
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
            let now = carrier.step(&injection);
            // `i` is the current at the start of the period in which the voltage acts, one sample
            // after the one it was computed from.
            let next = plant.p * i + plant.k * f64::from(now.voltage);
            if n > 5000 {
                assert!((0.5 * (i + next) - f64::from(now.mean_current)).abs() < 1e-5);
                let one_later = injection.sampled[(now.index + 1) % CARRIER_SAMPLES];
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
}
