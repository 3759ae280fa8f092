//! Tracking of the injection axis: the PII controller of the dissertation ([`Tracker`]), and the axis that follows the corrections of
//! the [filter](super::angle_filter) or the turn of the observer.
//!
//! The PII controller of Eq. 3.7 / 3.44 rotates the injection axis until `delta_i` equals its reference:
//! `u[k+1] = 2 u[k] - u[k-1] + k_s (e[k] - z_s e[k-1])`, written as two accumulators: the frequency, and
//! the angle, which wraps. Two integrators follow a flux of constant speed without steady-state error.

use core::f32::consts::TAU;

use super::angle_filter::Correction;
use super::hand_over::Turning;
use crate::Angle;

/// Coefficients of the PII tracker.
///
/// ```
/// use induction_drive_core::flux::{Tracker, TrackerState};
///
/// // The gains of section 3.11; at most 600 Hz at 6 kHz.
/// let tracker = Tracker::new(0.132_546, 0.9, 0.1);
/// let mut state = TrackerState::default();
/// // A steady error of 1 mA turns the axis faster and faster: two integrators.
/// let turned: Vec<f32> = (0..30).map(|_| { assert!(tracker.step(&mut state, 1e-3)); state.freq }).collect();
/// assert!(turned.windows(2).all(|pair| pair[1] > pair[0]));
/// // Without an error it keeps the frequency that it has.
/// let freq = { tracker.step(&mut state, 0.0); state.freq };
/// tracker.step(&mut state, 0.0);
/// assert_eq!(state.freq, freq);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracker {
    /// Gain, turns per period and ampere.
    gain: f32,
    /// Zero.
    zero: f32,
    /// Largest frequency, turns per period.
    limit: f32,
}

/// State of the tracking.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackerState {
    /// Angle of the injection axis at the present sample, electrical.
    pub angle: Angle,
    /// Frequency of the axis, electrical turns per period.
    pub freq: f32,
    error: f32,
    /// Acceleration of the rotor, electrical turns per period squared.
    pub(super) acceleration: f32,
}

impl Tracker {
    /// Creates a tracker with gain `k_s`, rad/A, and zero `z_s` of Eq. 3.44; `limit` is the largest
    /// frequency, electrical turns per period, below 1/2.
    pub fn new(k_s: f32, z_s: f32, limit: f32) -> Self {
        Self { gain: k_s / TAU, zero: z_s, limit }
    }

    /// Advances by one period with `error` = reference - `delta_i`, A. Returns false when the frequency
    /// has reached its limit or is NaN, which means that the angle is lost.
    pub fn step(&self, state: &mut TrackerState, error: f32) -> bool {
        let freq = state.freq + self.gain * (error - self.zero * state.error);
        state.error = error;
        state.freq = freq;
        state.angle += Angle::within_turn(freq);
        freq < self.limit && freq > -self.limit
    }
}

/// Share of the newest value in the speed from the observer: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;
/// Share by which the acceleration decays in a period while the observer gives the angle.
const FORGETTING: f32 = 0.01;
impl TrackerState {
    /// Advances by one period while saliency and voltage track: with the latest correction and the slip or, while the observer
    /// leads, by the turn of the observer. `rotor_freq` is the speed of the rotor; frequencies are in electrical turns per period.
    /// Returns whether the turn is finite. (The drive checks that the speed is finite and within limits.)
    #[inline(always)] // runs in every period, with its values in registers
    pub fn step(
        &mut self,
        rotor_freq: &mut f32,
        correction: &Correction,
        slip_freq: f32,
        turning: &Turning,
    ) -> bool {
        let turn = if turning.leads {
            self.acceleration *= 1.0 - FORGETTING;
            *rotor_freq += ROTOR_SMOOTHING * (turning.turned - turning.slip - *rotor_freq);
            let freq = *rotor_freq + slip_freq;
            // The turn belongs to an older current, so the change of the speed since then is compensated.
            let turn = turning.turned + turning.age * (freq - self.freq);
            self.freq = freq;
            turn
        } else {
            self.acceleration += correction.acceleration;
            *rotor_freq += correction.speed + self.acceleration;
            self.freq = *rotor_freq + slip_freq;
            self.freq + correction.angle
        };
        self.angle += Angle::within_turn(turn);
        turn.is_finite()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;

    /// A turn that is NaN leaves speed and frequency finite, so without a report it would be undetected.
    #[test]
    fn a_turn_that_is_no_number_is_told() {
        for leads in [false, true] {
            for (angle, turned) in [(f32::NAN, 0.0), (0.0, f32::NAN), (0.0, 0.0)] {
                let (mut state, mut rotor_freq) = (TrackerState::default(), 0.01);
                let correction = Correction { angle, ..Correction::default() };
                let turning = Turning { leads, turned, ..Turning::default() };
                let finite = state.step(&mut rotor_freq, &correction, 0.0, &turning);
                let used = if leads { turned } else { angle };
                assert_eq!(finite, used.is_finite());
            }
        }
    }

    /// Corrections change angle, speed and acceleration; the slip is fed forward. A source that does not lead changes nothing.
    #[test]
    fn corrections_and_slip_move_the_axis_until_the_observer_leads() {
        let (mut state, mut rotor_freq) = (TrackerState::default(), 0.001);
        let correction = Correction { angle: 1e-3, speed: 1e-5, acceleration: 1e-6 };
        let seen = Turning { leads: false, turned: 0.4, slip: 0.3, age: 2.0 };
        for n in 1..=3_u8 {
            let before = state.angle;
            assert!(state.step(&mut rotor_freq, &correction, 2e-4, &seen));
            let n = f32::from(n);
            // The speed rises by 1e-5 per period, and by 1e-6 + 2e-6 + ... due to the acceleration.
            let speed = 0.001 + 1e-5 * n + 1e-6 * 0.5 * n * (n + 1.0);
            assert!((rotor_freq - speed).abs() < 1e-8);
            assert!(((state.angle - before).to_turns() - (speed + 2e-4 + 1e-3)).abs() < 1e-6);
        }
        // While the observer leads, the axis rotates with its turn; without an age the change of the speed does not matter.
        let led = Turning { leads: true, turned: 0.02, slip: 2e-4, age: 0.0 };
        let before = state.angle;
        assert!(state.step(&mut rotor_freq, &correction, 2e-4, &led));
        assert!(((state.angle - before).to_turns() - 0.02).abs() < 1e-6);
        for _ in 0..600 {
            state.step(&mut rotor_freq, &correction, 2e-4, &led);
        }
        assert!((rotor_freq - (0.02 - 2e-4)).abs() < 1e-6);
    }

    #[test]
    fn follows_equation_3_44() {
        let (k_s, z_s) = (0.132_546, 0.9);
        let tracker = Tracker::new(k_s as f32, z_s as f32, 0.1);
        let mut state = TrackerState::default();
        let (mut u, mut last, mut e1) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..200 {
            let e = 0.01 * f64::from(k % 7) - 0.02;
            assert!(tracker.step(&mut state, e as f32));
            let next = 2.0 * u - last + k_s * (e - z_s * e1);
            (last, u, e1) = (u, next, e);
        }
        let turns = u / core::f64::consts::TAU;
        let difference = f64::from((state.angle - Angle::from_turns(turns as f32)).to_turns());
        assert!(difference.abs() < 1e-5, "{difference}");
    }

    #[test]
    fn says_when_it_runs_away() {
        let tracker = Tracker::new(0.13, 0.9, 0.01);
        let mut state = TrackerState::default();
        assert!((0..100_000).any(|_| !tracker.step(&mut state, 1.0)));
        assert!(!tracker.step(&mut TrackerState::default(), f32::NAN));
    }

    #[test]
    fn the_limit_holds_both_ways() {
        let step = |freq: f32| {
            let mut state = TrackerState { freq, ..TrackerState::default() };
            Tracker::new(0.13, 0.9, 0.01).step(&mut state, 0.0)
        };
        assert!(step(0.0099) && step(-0.0099) && !step(0.0101) && !step(-0.0101));
    }

    #[test]
    fn the_zero_keeps_the_frequency() {
        let tracker = Tracker::new(0.01 * TAU, 0.5, 0.1);
        let mut state = TrackerState::default();
        assert!(tracker.step(&mut state, 1.0)); // one ampere: 0.01 turns per period
        assert!((state.freq - 0.01).abs() < 1e-7 && (state.angle.to_turns() - 0.01).abs() < 1e-7);
        assert!(tracker.step(&mut state, 0.5)); // e[k] = z_s e[k-1]: the frequency is kept
        assert!((state.freq - 0.01).abs() < 1e-7 && (state.angle.to_turns() - 0.02).abs() < 1e-7);
        assert!(!tracker.step(&mut state, 100.0)); // beyond the speed limit: the angle is lost
    }
}
