//! The coefficients of the estimator of the flux angle.

use num_complex::Complex64;

use crate::settings::Settings;
use drive_core::FirstOrder;
use drive_core::carrier::{Asymmetry, CARRIER_SAMPLES, DemodulatorKind};
use drive_core::flux::{
    AngleLoop, ConstantReference, Estimator, GainSchedule, Pll, Reference, Tracker,
};

/// Group delay of the band-pass at 600 Hz, samples: by so much the envelope of the carrier current
/// lags.
const BPF_GROUP_DELAY: f32 = 8.83;

/// Delay, samples, of the envelope of the carrier current behind that of its voltage: the group delay
/// of the plant k / (z - p) at the carrier, less the half sample by which the voltage is held. The
/// angle of the voltage is that of the middle of its period already. 0.053 for the motor of Table 5:
/// left out, it is 0.9° at 600 rpm.
pub(super) fn carrier_lag(plant: FirstOrder) -> f32 {
    let turn = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
    let Complex64 { re: c, im: s } = Complex64::cis(turn);
    let (re, im) = (c - plant.p, s);
    ((1.0 - plant.p * c) / (re * re + im * im) - 0.5) as f32
}

impl Settings {
    /// `carrier_lag` is the delay, samples, from the injection axis to the sampled carrier current;
    /// `carrier_v`, V, and `carrier_a`, A, the amplitudes of the injected voltage and of that current.
    pub(super) fn estimator(
        &self,
        lag_share: f32,
        carrier_lag: f32,
        speed_limit: f32,
        (carrier_v, carrier_a): (f32, f32),
    ) -> Estimator {
        let limit = 1.5 * speed_limit;
        let inj = &self.injection;
        let (p, t) = (&inj.printed, &inj.synchronous);
        let angle_loop = if inj.demodulator == DemodulatorKind::Synchronous {
            AngleLoop::Pll {
                schedule: GainSchedule::new(
                    &self.reference(),
                    &self.slope(),
                    self.current_saliency(),
                    self.i_d(),
                ),
                pll: Pll::new(t.bandwidth_hz),
                asymmetry: Asymmetry::default(),
                largest_drift: 0.0,
            }
        } else {
            AngleLoop::Pii {
                reference: match p.learned {
                    Some(table) => Reference::Learned(table),
                    None => Reference::Constant(ConstantReference {
                        full: p.reference_a,
                        slope: p.reference_a / self.full_reference_iq_a(),
                        from: self.full_reference_iq_a(),
                    }),
                },
                tracker: Tracker::new(p.k_s, p.z_s, limit),
            }
        };
        Estimator {
            demodulator: inj.demodulator,
            rms_samples: p.rms_samples,
            // A saliency s makes differences of sqrt2 I s and 2 Z s, Z = V/I.
            ampere_per_ohm: if carrier_v > 0.0 {
                carrier_a * carrier_a / carrier_v * core::f32::consts::FRAC_1_SQRT_2
            } else {
                0.0
            },
            angle_loop,
            lag: lag_share * carrier_lag,
            band_pass_lag: lag_share * BPF_GROUP_DELAY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_carrier_lags_by_the_plant() {
        // 0.053 samples, 0.9° at 600 rpm, for the motor of Table 5.
        let plant = FirstOrder { k: 0.003_205_2, p: 0.980_053 };
        assert!((carrier_lag(plant) - 0.053).abs() < 5e-4, "{}", carrier_lag(plant));
        // -d arg(1/(z - p)) / d omega, less the half sample of the hold.
        let arg = |omega: f64| -(Complex64::cis(omega) - plant.p).arg();
        let w = core::f64::consts::TAU / CARRIER_SAMPLES as f64;
        let lag = -(arg(w + 1e-5) - arg(w - 1e-5)) / 2e-5 - 0.5;
        assert!((f64::from(carrier_lag(plant)) - lag).abs() < 1e-6);
    }
}
