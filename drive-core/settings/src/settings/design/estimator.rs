//! Coefficients of the estimator of the flux angle.

use core::f32::consts::{FRAC_1_SQRT_2, TAU};

use num_complex::Complex64;

use crate::settings::Settings;
use drive_core::FirstOrder;
use drive_core::carrier::{Asymmetry, CARRIER_S, CARRIER_SAMPLES};
use drive_core::flux::{AngleFilter, AngleLoop, Estimator, FilterLoop, GainSchedule};
use drive_core::printed::PrintedSettings;

/// Group delay of the band-pass at 600 Hz, samples, which is the lag of the envelope of the
/// injection current.
const BPF_GROUP_DELAY: f32 = 8.83;

/// Noise of a current sensor with the dissertation's sensors, A.
pub(super) const NOISE_A: f32 = 0.005;
/// Standard deviation of the saliency relative to that noise over the injection current, with the correlation of the averages.
const AVERAGED_NOISE: f32 = 0.68;
/// Standard deviation of the observed speed, relative to the deviation that the noise of one sample makes in an injection period.
const SEEN_NOISE: f32 = 2.8;
/// Change of the load that is assumed once a second, relative to the rated torque.
const LOAD_STEP: f32 = 0.16;
/// Lag of the saliency offset after a step of the q-axis current, as a share of that step, in angle of the stator current.
const REFERENCE_LAG: f32 = 0.14;
/// Standard deviation of the slow error of the observed speed: the part that all motors have, rad/s, which is due to the inverter
/// voltage error, a thousandth of the dc link over the flux; the part that grows with the rated frequency, relative to it, which is
/// due to the leakage; and the part that grows with the largest slip, relative to it. (Without the last one, a voltage error turned the
/// angle of a motor of 180 W, whose slip is 7.5 Hz, by 3 degrees: the filter then trusts the decay of the angle error more than the
/// injection.)
const SLOW: f32 = 1.3;
const SLOW_OF_RATED: f32 = 0.002;
const SLOW_OF_SLIP: f32 = 0.05;
/// Time constant of that error, in rotor time constants, and its upper limit, s.
const SLOW_OF_TAU_R: f32 = 25.0;
const SLOW_S: f32 = 2.0;
/// Saturation that is assumed: the magnetising current is `psi/L (1 + y)` with `y = SATURATED (psi/psi_rated)^KNEE`. The incremental
/// inductance is then smaller than the chord one by `(1 + y)/(1 + (KNEE + 1) y)`.
const SATURATED: f32 = 0.5;
const KNEE: f32 = 6.0;
/// Standard deviation of the speed that is added in a second, rad/s: the slip changes while the rotor warms up.
const SLIP: f32 = 2.0;
/// Assumed relative error of the leakage inductance.
const LEAKAGE_ERROR: f32 = 0.1;

/// Returns the delay, samples, of the envelope of the injection current behind the envelope of its
/// voltage. It is the group delay of the plant k / (z - p) at the injection frequency, less the half
/// sample by which the voltage is held, because the angle of the voltage is already taken in the
/// middle of its period. The motor of Table 5 has 0.053 samples, which would be an error of 0.9° at
/// 600 rpm.
pub(super) fn carrier_lag(plant: FirstOrder) -> f32 {
    let turn = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
    let Complex64 { re: c, im: s } = Complex64::cis(turn);
    let (re, im) = (c - plant.p, s);
    ((1.0 - plant.p * c) / (re * re + im * im) - 0.5) as f32
}

impl Settings {
    /// Returns the estimator. `carrier_lag` is the delay, samples, from the injection axis to the
    /// sampled injection current; `carrier_v`, V, and `carrier_a`, A, are the amplitudes of the
    /// injected voltage and of that current.
    pub(super) fn estimator<L: AngleLoop>(
        &self,
        lag_share: f32,
        carrier_lag: f32,
        speed_limit: f32,
        (carrier_v, carrier_a): (f32, f32),
    ) -> Estimator<L> {
        let filter = FilterLoop {
            schedule: GainSchedule::new(&self.reference(), &self.slope()),
            filter: self.angle_filter(carrier_a),
            asymmetry: Asymmetry::default(),
        };
        let p = &self.injection.printed;
        let some_v = if carrier_v > 0.0 { carrier_v } else { f32::INFINITY };
        let printed = PrintedSettings {
            demodulator: self.injection.demodulator,
            rms_samples: p.rms_samples,
            // A saliency s makes a current difference of sqrt2 I s and an impedance difference of 2 Z s, with Z = V/I.
            ampere_per_ohm: carrier_a * carrier_a / some_v * FRAC_1_SQRT_2,
            band_pass_lag: lag_share * BPF_GROUP_DELAY,
            reference_a: (p.reference_a, self.full_reference_iq_a()),
            learned: p.learned,
            k_s: p.k_s,
            z_s: p.z_s,
            limit: 1.5 * speed_limit,
        };
        let sign = self.injection.axis.sign();
        Estimator { angle_loop: L::of(filter, &printed), lag: lag_share * carrier_lag, sign }
    }

    /// Returns the variances of the angle filter, from motor, inverter and sensors, for an amplitude `carrier_a` of the injection
    /// current, A.
    fn angle_filter(&self, carrier_a: f32) -> AngleFilter {
        let (m, i_d, noise_a) = (&self.motor, self.i_d(), self.share_of_range(NOISE_A));
        let flux = m.coupled_inductance() * i_d;
        // This is the speed error of the observer per change of the current.
        let per_a = m.sigma_l_s() / (flux * CARRIER_S);
        let saliency = AVERAGED_NOISE * noise_a / carrier_a;
        let rate = if self.uses_observer() {
            let rated = self.nameplate.power_w / (TAU / 60.0 * self.nameplate.speed_rpm);
            LOAD_STEP * rated * f32::from(m.pole_pairs) / self.inertia()
        } else {
            let angle = saliency / self.slope().at_rest();
            let w = TAU * self.injection.synchronous.bandwidth_hz;
            angle * libm::sqrtf(CARRIER_S) * w * w * w
        };
        let square = |x: f32| x * x;
        let alpha = if self.uses_observer() { 1.0 / m.tau_r() } else { 0.0 };
        let y = SATURATED * libm::powf(flux / self.nameplate.flux(), KNEE);
        let delta = alpha * (1.0 + (KNEE + 1.0) * y) / (1.0 + y);
        AngleFilter {
            rate: square(rate),
            slip: square(SLIP),
            saliency: square(saliency),
            angle_per_a: REFERENCE_LAG / i_d,
            speed: square(SEEN_NOISE * noise_a * per_a),
            speed_per_a: LEAKAGE_ERROR * per_a,
            kept: [alpha, delta].map(|rate| libm::expf(-AngleFilter::SPAN_S * rate)),
            delta,
            slow: square(SLOW)
                + square(SLOW_OF_SLIP * self.largest_slip())
                + square(SLOW_OF_RATED * TAU * self.nameplate.frequency_hz),
            slow_rate: f32::max(1.0 / (SLOW_OF_TAU_R * m.tau_r()), 1.0 / SLOW_S),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_carrier_lags_by_the_plant() {
        // The motor of Table 5 has 0.053 samples, 0.9° at 600 rpm.
        let plant = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
        assert!((carrier_lag(plant) - 0.053).abs() < 5e-4, "{}", carrier_lag(plant));
        // The expected delay is -d arg(1/(z - p)) / d omega, less the half sample of the hold.
        let arg = |omega: f64| -(Complex64::cis(omega) - plant.p).arg();
        let w = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
        let lag = -(arg(w + 1e-5) - arg(w - 1e-5)) / 2e-5 - 0.5;
        assert!((f64::from(carrier_lag(plant)) - lag).abs() < 1e-6);
    }
}
