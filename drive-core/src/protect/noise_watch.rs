//! Noise watch: detects current-sensor noise that would disturb the tracked angle.
//!
//! Sensor noise disturbs the angle before it has any other effect: 15 mA rms in one sensor, 0.4 % of its
//! range, cause errors of 15°. The noise is measured in a combination of samples that contains no signal.
//! Once per injection period each channel forms the second difference of three consecutive samples, and
//! the second difference of these over the injection periods:
//!
//! ```text
//! h = i[n] - 2 i[n-1] + i[n-2]        d = h - 2 h[1] + h[2]        [m]: m injection periods ago
//! ```
//!
//! The first rejects most of the fundamental. The second rejects all of the injection current at
//! standstill and 95 % of it at 700 rpm. White noise appears in `d` with 36 times its variance. The mean
//! square of `d` over 67 ms is compared with that of the allowed noise.
//!
//! The allowed noise is 1.1 times the part of the injection current that is caused by the saliency,
//! `|a| I`, which is 9.1 mA for 3.5 % of 0.26 A. With a smaller injection it is twice the noise for which the
//! angle filter is designed, because that filter follows a smaller injection more slowly. The results were
//! measured on the simulated motor with 12-bit ADCs and 5 mA in the other sensor, in 200 runs of a second for
//! each row and q-axis current, 0.5 A to 3 A, with the shaft locked:
//!
//! | noise of one sensor, rms | largest angle error without the watch | time to the fault, mean and longest |
//! |---|---|---|
//! | 5 mA | 6.5° | never |
//! | 7.8 mA | 11° | one run in ten within the second |
//! | 11 mA | 15.9° | 135 ms, 445 ms |
//! | 13.5 mA | 19° | 76 ms, 190 ms |
//! | 16 mA | 22° | 54 ms, 122 ms |
//! | 30 mA | 41° | 26 ms, 51 ms |
//! | 100 mA | | 18 ms, 25 ms |
//!
//! Later than 100 ms after the onset of the noise, one of these 7200 runs and as many at 300 rpm exceeded
//! 15° with the outputs on, by 1.2°. With 5 mA in both sensors the mean square reached at most 0.7 of the
//! allowed one in 2400 s with reversals of 3 A and up to 600 rpm.
//!
//! While the observer takes part in the angle, five times the noise is allowed. The injection, which rotates and is switched,
//! and the fundamental wave at speed appear in `d` (2 A at 3000 rpm like 3 mA of noise). Noise also turns the angle less: 178
//! mA rms by 15° at 3000 rpm, 360 mA by 20° at 1800 rpm and by 39° at 900 rpm (1.4 A of d-axis current, found without this
//! limit).

use crate::{Fault, Measured};

/// Allowed noise relative to the injection current caused by the saliency, and relative to the noise of the design.
const ALLOWED: f32 = 1.1;
const ALLOWED_OF_DESIGN: f32 = 1.98;
/// Allowed noise while the observer takes part in the angle, relative to the allowed noise without it.
const AT_SPEED: f32 = 5.0;
/// Variance of `d` for white noise of variance 1: sum of the squared weights, 6 times 6.
const WEIGHTS: f32 = 36.0;
/// Share of the newest square in the mean: 40 injection periods.
const SMOOTHING: f32 = 1.0 / 40.0;
/// Clamp of one square relative to the allowed mean square, so that a current step does not trip.
const MOST: f32 = 4.0;
/// Samples per channel and injection period.
const LOOKS: usize = 3;

/// Coefficients of the watch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NoiseWatch {
    /// Reciprocal of the allowed mean square of `d` without the observer, 1/A^2.
    per_allowed: f32,
}

/// State of the watch.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoiseWatchState {
    channels: [Channel; 2],
}

/// State of one sensor's watch.
#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    /// Partial sum of `h`, A.
    difference: f32,
    /// `h` of the last two injection periods, A.
    last: [f32; 2],
    /// Mean square of `d` relative to the allowed one, so that it stays valid when the allowed noise changes.
    level: f32,
}

impl NoiseWatch {
    /// Creates the watch for a flux-fixed saliency, an injection current of `carrier_a`, A peak, and the sensor noise for which the
    /// angle filter is designed, A rms.
    pub fn new(flux_saliency: f32, carrier_a: f32, design_a: f32) -> Self {
        let of_carrier = ALLOWED * flux_saliency * carrier_a;
        let allowed = of_carrier.abs().max(ALLOWED_OF_DESIGN * design_a);
        Self { per_allowed: 1.0 / (WEIGHTS * allowed * allowed) }
    }

    /// Processes a sample, number `look` of six per injection period: 0 to 2 are three consecutive samples for channel a, 3
    /// to 5 for channel b. `quiet`: whether the injection alone has given the angle for a while.
    ///
    /// # Errors
    /// [`Fault::SensorNoisyA`] or [`Fault::SensorNoisyB`], with the third sample of the channel.
    pub fn step(
        &self,
        state: &mut NoiseWatchState,
        look: usize,
        measured: &Measured,
        quiet: bool,
    ) -> Result<(), Fault> {
        let [a, b] = &mut state.channels;
        let phases = &measured.phases;
        let (channel, current, fault, look) = if look < LOOKS {
            (a, phases.a, Fault::SensorNoisyA, look)
        } else {
            (b, phases.b, Fault::SensorNoisyB, look - LOOKS)
        };
        match look {
            0 => channel.difference = current,
            1 => channel.difference -= 2.0 * current,
            _ => {
                channel.difference += current;
                fault.unless(channel.is_still(self.per_allowed, quiet))?;
            }
        }
        Ok(())
    }
}

impl Channel {
    /// Updates the mean square and returns whether it is within the allowed one.
    fn is_still(&mut self, per_allowed: f32, quiet: bool) -> bool {
        let [one, two] = self.last;
        let d = self.difference - 2.0 * one + two;
        self.last = [self.difference, one];
        let square =
            d * d * if quiet { per_allowed } else { per_allowed * (1.0 / (AT_SPEED * AT_SPEED)) };
        let square = if square < MOST { square } else { MOST };
        self.level += SMOOTHING * (square - self.level);
        self.level <= 1.0
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use crate::math::frames::Abc;
    use core::f64::consts::TAU;

    /// A per ADC count.
    const GAIN: f32 = 0.0022;

    /// Returns a watch for 9.1 mA, which allows 10 mA.
    fn watch() -> NoiseWatch {
        NoiseWatch::new(-0.035, 0.26, 0.005)
    }

    /// Returns two currents, A, as sampled by an ADC.
    fn sample(currents: [f64; 2]) -> Measured {
        let [a, b] = currents.map(|i| (i / f64::from(GAIN)).round() as f32 * GAIN);
        Measured { phases: Abc::new(a, b, -(a + b)), ..Measured::default() }
    }

    /// Processes sample `n` of ten in an injection period, of which the watch uses three in each half.
    fn look(
        watch: &NoiseWatch,
        state: &mut NoiseWatchState,
        n: usize,
        measured: &Measured,
        quiet: bool,
    ) -> Result<(), Fault> {
        match n % 10 {
            at @ 0..3 => watch.step(state, at, measured, quiet),
            at @ 7..10 => watch.step(state, at - 4, measured, quiet),
            _ => Ok(()),
        }
    }

    /// Returns normal noise of variance 1 as the sum of twelve random numbers.
    fn normal(x: &mut u64) -> f64 {
        let mut uniform = || {
            *x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*x >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    /// Frequency above which there is no injection, Hz.
    const CARRIER_HZ: f64 = 26.0;

    /// Returns the seconds until the fault, at most `seconds`, of a motor with 3 A at `hz` and an
    /// injection that rotates with it. `noise` is the noise of both sensors, A rms.
    fn until(noise: [f64; 2], hz: f64, seconds: f64, seed: u64) -> Option<(f64, Fault)> {
        let carrier_a = if hz.abs() < CARRIER_HZ { 0.26 } else { 0.0 };
        let (watch, mut state, mut x) = (watch(), NoiseWatchState::default(), seed);
        (0..(6000.0 * seconds) as usize).find_map(|n| {
            let t = n as f64 / 6000.0;
            let [a, b] = [0.0, TAU / 3.0].map(|phase| {
                let angle = TAU * hz * t - phase;
                3.0 * angle.cos() + carrier_a * angle.sin() * (TAU * 600.0 * t + 0.4).cos()
            });
            let sample = sample([a + noise[0] * normal(&mut x), b + noise[1] * normal(&mut x)]);
            look(&watch, &mut state, n, &sample, carrier_a > 0.0).err().map(|fault| (t, fault))
        })
    }

    #[test]
    fn the_noise_of_sound_sensors_is_allowed_up_to_700_rpm() {
        for (seed, hz) in [(1, 0.0), (2, 2.0), (3, -10.0), (4, 24.0)] {
            assert_eq!(until([0.005, 0.005], hz, 60.0, seed), None, "{hz} Hz");
        }
    }

    #[test]
    fn a_noisy_sensor_is_found_and_named() {
        for seed in 1..20 {
            // With 16 mA the mean square is at the limit after 67 ms ln(1 / (1 - 0.39)) = 33 ms, on average.
            let (t, fault) = until([0.016, 0.005], 2.0, 1.0, seed).unwrap();
            assert!(t < 0.13 && fault == Fault::SensorNoisyA, "{t} {fault:?}");
            let (t, fault) = until([0.005, 0.1], -10.0, 1.0, seed).unwrap();
            assert!(t < 0.04 && fault == Fault::SensorNoisyB, "{t} {fault:?}");
        }
    }

    #[test]
    fn at_speed_the_fundamental_wave_is_no_noise_and_a_noisy_sensor_is_found() {
        for (seed, hz) in [(1, 30.0), (2, -60.0), (3, 100.0), (4, 120.0)] {
            assert_eq!(until([0.02, 0.02], hz, 10.0, seed), None, "{hz} Hz");
            // 90 mA have 3.2 times the mean square of 50 mA. The squares are clamped at 4, so the time is 52 ms on average,
            // and 123 ms at most in 200 simulations.
            let (t, fault) = until([0.005, 0.09], hz, 1.0, seed).unwrap();
            assert!(t < 0.15 && fault == Fault::SensorNoisyB, "{t} {fault:?}");
        }
    }

    #[test]
    fn a_step_of_the_current_is_no_noise() {
        let (watch, mut state) = (watch(), NoiseWatchState::default());
        for n in 0..60_000_usize {
            let i = if n / 1000 % 2 == 0 { 3.0 } else { -3.0 };
            // The watch becomes quiet directly after every seventh step.
            let quiet = n / 1010 % 7 > 0;
            assert_eq!(look(&watch, &mut state, n, &sample([i, -i]), quiet), Ok(()), "{n}");
        }
    }

    #[test]
    fn a_state_that_is_no_number_is_a_fault() {
        let (watch, mut state) = (watch(), NoiseWatchState::default());
        state.channels[1].level = f32::NAN;
        let found =
            (0..10).find_map(|n| look(&watch, &mut state, n, &sample([0.0; 2]), true).err());
        assert_eq!(found, Some(Fault::SensorNoisyB));
    }
}
