//! Travel watch: detects a current sensor whose signal does not change while the current turns.
//!
//! While a current of amplitude `I` turns, each phase current changes. It changes least at a flat place of its curve: at a peak, or where
//! a change of the torque and the turn act against each other. There the curve is flat to the third order, as `I theta^3/6` over the
//! turn `theta`, and stays within `s` of a reading for at most `5.4 (s/I)^(1/3)`. A channel that stays there for [`TURN`]` (s/I)^(1/3)` is
//! silent. No model and no voltage are involved, so no control action can hide the defect, and the rule holds for each motor and speed.
//!
//! If the d-axis current is far below `I`, a reversal of the torque leads the current through a small amplitude, and it can stay longer.
//! Therefore the watch rests after a quick change of the q-axis current; [`STEADY`] is the limit.
//!
//! There are two windows. A sensor that is stuck repeats its reading. The window of the smallest `s` detects it soonest; it takes one
//! channel in each sample, in turn. An open sensor shows noise. Its window is wider, and takes every other or third of these readings. The
//! time until the fault was simulated on the dissertation's motor at 900, 1800 and 3000 rpm: `tests/silent_sensors.rs`.

use core::f32::consts::TAU;

use crate::carrier::CARRIER_SAMPLES;
use crate::{Abc, AlphaBeta, Fault};

/// Turn of the current after which a channel is silent, rad for `s = I`.
const TURN: f32 = 6.0;
/// Least current that is judged, relative to the `s` of the narrow window.
const LEAST_CURRENT: f32 = 32.0;
/// Half width `s` of the narrow window, A on the reference board: one and a half readings of its converter.
const STUCK_A: f32 = 0.0033;
/// Largest change of the q-axis current that counts as none, relative to the d-axis current times the turn in the same time. Only above 1
/// can change and turn act against each other.
const STEADY: f32 = 0.5;

/// A window and its readings.
struct Window {
    /// Half width, relative to that of the narrow window.
    half: f32,
    /// Samples from one reading to the next, on average.
    every: usize,
    /// Least and largest number of readings, after the first one, that must agree with it. With fewer, a current of 400 Hz may be silent
    /// at its peak. More take longer than 7 ms or 8 ms: the current turns too slowly for the frequency, which is estimated, to tell its
    /// turn.
    least: u8,
    largest: u8,
}

const STUCK: Window = Window { half: 1.0, every: 2, least: 4, largest: 20 };
// Six times the noise.
const OPEN: Window = Window { half: 9.0, every: CARRIER_SAMPLES / 2, least: 3, largest: 10 };

/// Coefficient of the watch.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TravelWatch {
    /// Half width of the narrow window, A.
    half_a: f32,
    /// Reciprocal of its square, 1/A^2.
    per_square: f32,
}

/// State of the watch.
#[derive(Clone, Copy, Debug, Default)]
pub struct TravelWatchState {
    /// Channels a and b in each window.
    stuck: [Still; 2],
    open: [Still; 2],
    /// Sixth power of the frequency of the current, times the square of its amplitude. A channel is silent if the product with the sixth
    /// power of the time, in samples, is above the square of [`Window::half`].
    pace: f32,
}

/// A channel that stays within a window.
#[derive(Clone, Copy, Debug, Default)]
struct Still {
    /// First reading, in the middle of the window, A.
    first: f32,
    /// Number of readings after it, which agree with it.
    readings: u8,
}

impl TravelWatch {
    /// Creates the watch for sensors whose range is `range` times that of the reference board.
    pub fn new(range: f32) -> Self {
        let half_a = range * STUCK_A;
        Self { half_a, per_square: 1.0 / (half_a * half_a) }
    }

    /// Updates the pace; once an injection period. `current` is the measured current, A; `flux_freq` is the frequency of the flux, electrical turns per control period; `d` the
    /// d-axis current, A, and `moved` the largest recent change of the q-axis current in an injection period, A, both of the reference.
    pub fn see_turn(
        &self,
        state: &mut TravelWatchState,
        current: AlphaBeta,
        flux_freq: f32,
        (d, moved): (f32, f32),
    ) {
        const PER: f32 = 1.0 / sixth(TURN / TAU);
        let square = current.length_squared() * self.per_square;
        let judged = square > LEAST_CURRENT * LEAST_CURRENT;
        let pace = if judged { square * sixth(flux_freq) * PER } else { 0.0 };
        let steady = moved < STEADY * TAU * CARRIER_SAMPLES as f32 * d * flux_freq.abs();
        // A silent sensor soon disturbs frequency and current. Therefore the pace falls by at most a tenth.
        state.pace = if steady { f32::max(pace, 0.9 * state.pace) } else { 0.0 };
    }

    /// Reads the current of one channel in sample `index` of the injection period.
    ///
    /// # Errors
    /// [`Fault::SensorSilentA`] or [`Fault::SensorSilentB`].
    pub fn step(&self, s: &mut TravelWatchState, index: usize, phases: &Abc) -> Result<(), Fault> {
        let TravelWatchState { stuck, open, pace } = s;
        let (n, now, fault) = match index % STUCK.every {
            0 => (0, phases.a, Fault::SensorSilentA),
            _ => (1, phases.b, Fault::SensorSilentB),
        };
        fault.unless(self.follows(&mut stuck[n], now, *pace, &STUCK))?;
        let wide = matches!(index, 2 | 3 | 7 | 8);
        fault.unless(!wide || self.follows(&mut open[n], now, *pace, &OPEN))
    }

    /// Takes a reading, A, and returns whether the channel may follow the current.
    fn follows(&self, still: &mut Still, now: f32, pace: f32, of: &Window) -> bool {
        if (now - still.first).abs() > of.half * self.half_a {
            *still = Still { first: now, readings: 0 };
            return true;
        }
        still.readings = u8::min(still.readings + 1, of.largest);
        let samples = of.every as f32 * f32::from(still.readings);
        still.readings < of.least || sixth(samples) * pace <= of.half * of.half
    }
}

/// Returns the sixth power.
const fn sixth(x: f32) -> f32 {
    let square = x * x;
    square * square * square
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std trigonometry is the reference here
    use super::*;
    use core::f64::consts::TAU;

    /// Samples in a second.
    const RATE_HZ: f64 = 6000.0;

    /// Returns the seconds until the fault, at most 0.2 s, of a current whose vector is a function of the time. From `dead` on, seconds,
    /// a sensor has a constant value instead, with this noise.
    fn until(
        vector: impl Fn(f64) -> (f64, f64),
        hz: f64,
        (dead, sensor, shown, noise): (f64, usize, f64, f64),
    ) -> Option<(f64, Fault)> {
        let (watch, mut state) = (TravelWatch::new(1.0), TravelWatchState::default());
        (0..1200).find_map(|n| {
            let t = f64::from(n) / RATE_HZ;
            let (length, angle) = vector(t);
            let mut seen = [0.0, TAU / 3.0].map(|axis| length * (TAU * angle - axis).cos());
            if t >= dead {
                seen[sensor] = shown + noise * f64::from(n * n % 7 - 3) / 2.0;
            }
            // The readings of a converter.
            let [a, b] = seen.map(|i| (i / 0.0022).round() as f32 * 0.0022);
            let phases = Abc::new(a, b, -(a + b));
            let index = n as usize % CARRIER_SAMPLES;
            let freq = (hz / RATE_HZ) as f32;
            if index == 0 {
                let current = AlphaBeta::from_two_phases(phases.a, phases.b);
                watch.see_turn(&mut state, current, freq, (1.4, 0.0));
            }
            let fault = watch.step(&mut state, index, &phases).err()?;
            Some((t - dead, fault))
        })
    }

    /// Returns a current that turns steadily from this angle, turns.
    fn steady(ampere: f64, hz: f64, from: f64) -> impl Fn(f64) -> (f64, f64) {
        move |t| (ampere, from + hz * t)
    }

    /// Returns frequencies, Hz, and angles over a whole turn.
    fn cases() -> impl Iterator<Item = (f64, f64)> {
        let angles = |hz| (0..36).map(move |n| (hz, f64::from(n) / 36.0));
        let all = [0.0, 0.3, 2.0, -9.0, 30.0, -60.0, 100.0, 200.0, -299.0, 300.0, 400.0, -450.0];
        all.into_iter().flat_map(angles)
    }

    const NEVER: (f64, usize, f64, f64) = (1.0, 0, 0.0, 0.0);

    #[test]
    fn sensors_that_follow_are_not_silent() {
        for (hz, from) in cases() {
            for ampere in [0.02, 0.2, 0.7, 4.0] {
                assert_eq!(
                    until(steady(ampere, hz, from), hz, NEVER),
                    None,
                    "{ampere} {hz} {from}"
                );
            }
        }
    }

    /// The q-axis current reverses at any rate, at any angle: somewhere a phase current is flat to the third order.
    #[test]
    fn a_reversal_is_not_silent_however_fast() {
        for (hz, from) in cases() {
            for ms in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0] {
                let vector = |t: f64| {
                    let q = 3.0 - 6.0 * ((1e3 * t - 20.0) / ms).clamp(0.0, 1.0);
                    (q.hypot(1.4), from + hz * t + q.atan2(1.4) / TAU)
                };
                assert_eq!(until(vector, hz, NEVER), None, "{hz} Hz, {from}, {ms} ms");
            }
        }
    }

    /// A sensor that repeats a reading is named within the turn of the narrow window and three samples, or 2 ms; one with 5 mA of noise
    /// within that of the wide one and two of its readings.
    #[test]
    fn a_sensor_that_stands_is_named_within_its_turn() {
        for (hz, from) in cases().filter(|(hz, _)| hz.abs() >= 30.0) {
            for (sensor, fault) in [(0, Fault::SensorSilentA), (1, Fault::SensorSilentB)] {
                for (shown, noise, within, wait_ms) in
                    [(0.0, 0.0, 0.0033, 2.0), (1.7, 0.0, 0.0033, 2.0), (0.0, 0.005, 0.03, 4.2)]
                {
                    let found = until(steady(3.0, hz, from), hz, (0.05, sensor, shown, noise));
                    let (s, named) = found.unwrap();
                    assert_eq!(named, fault, "{hz} {from} {shown}");
                    // Where the other phase current is small as well, so is the measured one: another tenth of a turn.
                    let turn = 6.0 * (within / 3.0_f64).cbrt() / TAU + 0.1;
                    let most = turn / hz.abs() + 1e-3 * wait_ms;
                    assert!(s <= most, "{hz} Hz, {from}, {shown}, {noise}: {s} of {most}");
                }
            }
        }
    }

    /// Without a turn, or without a current, nothing is judged.
    #[test]
    fn where_nothing_turns_nothing_is_judged() {
        assert_eq!(until(steady(3.0, 0.0, 0.1), 0.0, (0.0, 1, 0.0, 0.0)), None);
        assert_eq!(until(steady(0.08, 60.0, 0.0), 60.0, (0.0, 1, 0.0, 0.0)), None);
    }
}
