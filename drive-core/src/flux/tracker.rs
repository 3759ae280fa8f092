//! Tracking of the injection axis: the PII controller of the dissertation ([`Tracker`]) and the type-3 loop
//! of the synchronous demodulation ([`Pll`]).
//!
//! The PII controller of Eq. 3.7 / 3.44 rotates the injection axis until `delta_i` equals its reference:
//! `u[k+1] = 2 u[k] - u[k-1] + k_s (e[k] - z_s e[k-1])`, written as two accumulators: the frequency, and
//! the angle, which wraps. Two integrators follow a flux of constant speed without steady-state error.

use core::f32::consts::TAU;

use super::hand_over::Turning;
use crate::math::limited;
use crate::{Angle, PERIOD_S};

/// Third pole of the flux-tracking loop relative to its natural frequency, where the other two poles lie.
pub const THIRD_POLE: f64 = 0.2;

/// Coefficients of the PII tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracker {
    /// Gain, turns per period and ampere.
    gain: f32,
    /// Zero.
    zero: f32,
    /// Largest frequency, turns per period.
    limit: f32,
}

/// State of [`Tracker`] and [`Pll`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackerState {
    /// Angle of the injection axis at the present sample, electrical.
    pub angle: Angle,
    /// Its frequency, electrical turns per period.
    pub freq: f32,
    error: f32,
    /// Acceleration, electrical turns per period squared.
    acceleration: f32,
}

impl Tracker {
    /// Tracker with gain `k_s`, rad/A, and zero `z_s` of Eq. 3.44; `limit` is the largest frequency,
    /// electrical turns per period, below 1/2.
    pub fn new(k_s: f32, z_s: f32, limit: f32) -> Self {
        Self { gain: k_s / TAU, zero: z_s, limit }
    }

    /// Advances by one period with `error` = reference - `delta_i`, A. Returns false when the frequency
    /// has reached its limit or is NaN: the angle is lost.
    pub fn step(&self, state: &mut TrackerState, error: f32) -> bool {
        let freq = state.freq + self.gain * (error - self.zero * state.error);
        state.error = error;
        state.freq = freq;
        state.angle += Angle::within_turn(freq);
        freq < self.limit && freq > -self.limit
    }
}

/// Coefficients of the type-3 loop of the synchronous demodulation. Its speed and acceleration states are
/// those of the rotor; the slip is fed forward.
///
/// ```text
/// a += T k_a e      w_i += T (a + k_i e)      w = w_i + slip      theta += T (w + k_p g e)
/// (s + w_n)^2 (s + c w_n) = s^3 + k_p s^2 + k_i s + k_a           c = 0.2
/// ```
///
/// `w_i` estimates the electrical speed of the rotor. Without the acceleration state the angle would lag by
/// the acceleration over w_n^2 (11° at 600 rpm/s, 4 Hz and four poles); with braking torque such a lag
/// weakens the flux, and with it the gain of the loop. The third pole is slow so that the loop stays stable
/// down to a fifteenth of its gain. The schedule `g` scales the proportional part only: the gain rises with
/// the torque current for fast errors, but not for slow ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pll {
    /// Turns per period and radian.
    proportional: f32,
    /// Turns per period, per period and radian.
    integral: f32,
    /// Turns per period, per period squared and radian.
    jerk: f32,
}

/// Share of the newest value in the speed that the observer sees: 5 ms.
const ROTOR_SMOOTHING: f32 = 1.0 / 30.0;
/// Share of the acceleration that is forgotten in a period where the observer has the angle.
const FORGETTING: f32 = 0.01;
/// Clamp of the angle error, rad.
const LARGEST_ERROR: f32 = 0.6;

impl Pll {
    /// Loop with the natural frequency w_n = 2 pi `bandwidth_hz`.
    pub fn new(bandwidth_hz: f32) -> Self {
        let w = TAU * bandwidth_hz * PERIOD_S;
        let c = THIRD_POLE as f32;
        Self {
            proportional: (2.0 + c) * w / TAU,
            integral: (1.0 + 2.0 * c) * w * w / TAU,
            jerk: c * w * w * w / TAU,
        }
    }

    /// Correction for an angle `error`, rad, with the scheduled `share` of the proportional gain. `known`
    /// is the rotor's acceleration reference, electrical turns per period squared, fed forward.
    pub fn correction(&self, error: f32, share: f32, known: f32) -> PllCorrection {
        let error = limited(error, LARGEST_ERROR);
        PllCorrection {
            angle: self.proportional * share * error,
            speed: self.integral * error + known,
            acceleration: self.jerk * error,
        }
    }

    /// Advances by one period with the latest correction and the slip, and with the `turning` that the observer sees by its
    /// weight. `rotor_freq` is the speed state; frequencies in electrical turns per period. Returns whether the turn is finite.
    /// (The drive checks that the speed is finite and within limits.)
    #[inline(always)] // a part of every period, with its values in registers
    pub fn step(
        state: &mut TrackerState,
        rotor_freq: &mut f32,
        correction: PllCorrection,
        slip_freq: f32,
        turning: &Turning,
    ) -> bool {
        let w = turning.weight;
        let seen_rotor = turning.turned - turning.slip;
        state.acceleration =
            (state.acceleration + (1.0 - w) * correction.acceleration) * (1.0 - FORGETTING * w);
        *rotor_freq += (1.0 - w) * (correction.speed + state.acceleration)
            + w * ROTOR_SMOOTHING * (seen_rotor - *rotor_freq);
        let freq = *rotor_freq + slip_freq;
        let tracked = freq + correction.angle;
        // The turn is that of an older current: the change of the speed since then is made up for.
        let seen = turning.turned + turning.age * (freq - state.freq);
        state.freq = freq;
        let turn = tracked + w * (seen - tracked);
        state.angle += Angle::within_turn(turn);
        turn.is_finite()
    }
}

/// Increments of the loop's states per period, caused by an angle error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PllCorrection {
    /// Increment of the angle, electrical turns.
    pub angle: f32,
    /// Increment of the speed, electrical turns per period.
    pub speed: f32,
    /// Increment of the acceleration, electrical turns per period squared.
    pub acceleration: f32,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;

    /// A turn that is no number leaves speed and frequency finite: it would go unseen as one of nothing.
    #[test]
    fn a_turn_that_is_no_number_is_told() {
        let turning = Turning { weight: 1.0, ..Turning::default() };
        for (angle, turned) in [(f32::NAN, 0.0), (0.0, f32::NAN), (0.0, 0.0)] {
            let (mut state, mut rotor_freq) = (TrackerState::default(), 0.01);
            let correction = PllCorrection { angle, ..PllCorrection::default() };
            let turning = Turning { turned, ..turning };
            let finite = Pll::step(&mut state, &mut rotor_freq, correction, 0.0, &turning);
            assert_eq!(finite, angle.is_finite() && turned.is_finite());
        }
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

    /// The angle of the loop, turns, while `truth` turns, and the acceleration that it knows of.
    fn tracked(truth: impl Fn(f64) -> f64, share: f32, known: f32, periods: u32) -> (f64, f32) {
        let pll = Pll::new(4.0);
        let (mut state, mut rotor_freq) = (TrackerState::default(), 0.0);
        let mut error = Angle::ZERO;
        for k in 0..periods {
            error = Angle::from_turns(truth(f64::from(k)) as f32) - state.angle;
            let push = pll.correction(error.to_radians(), share, known);
            Pll::step(&mut state, &mut rotor_freq, push, 1e-4, &Turning::default());
        }
        (error.to_turns().into(), rotor_freq)
    }

    #[test]
    fn the_loop_has_its_three_poles() {
        // s^3 + k_p s^2 + k_i s + k_a with w_n, w_n and w_n / 5, in f64, from an error of 0.05 turns; the
        // slip that is fed forward moves the angle by itself.
        for share in [1.0, 0.8] {
            let w = core::f64::consts::TAU * 4.0 / 6000.0;
            let (k_p, k_i, k_a) = (2.2 * w * f64::from(share), 1.4 * w * w, 0.2 * w * w * w);
            let (mut angle, mut speed, mut acceleration) = (0.0, 0.0, 0.0);
            for periods in 1..=3000 {
                let error = 0.05 - angle;
                acceleration += k_a * error;
                speed += k_i * error + acceleration;
                angle += speed + k_p * error;
                if periods % 250 == 0 {
                    let (got, freq) = tracked(|k| 0.05 + 1e-4 * k, share, 0.0, periods);
                    assert!((got - error).abs() < 2e-4, "{periods}: {got} for {error}");
                    assert!((f64::from(freq) - speed).abs() < 1e-6, "{periods}");
                }
            }
        }
    }

    #[test]
    fn an_accelerating_rotor_is_followed_without_lag() {
        // 600 rpm/s with two pole pairs, in turns per period and period.
        let a = 600.0 / 60.0 * 2.0 / 6000.0_f64.powi(2);
        let truth = |k: f64| 1e-4 * k + 0.5 * a * k * k;
        let (error, freq) = tracked(truth, 1.0, 0.0, 9000);
        assert!(
            error.abs() < 1e-3 && (f64::from(freq) - a * 9000.0).abs() < 1e-5,
            "{error} {freq}"
        );
        // Known, it does not lag even at first: otherwise 11 degrees.
        let (lag, _) = tracked(truth, 1.0, 0.0, 900);
        let (error, _) = tracked(truth, 1.0, a as f32, 900);
        assert!(lag > 0.015 && error.abs() < 1e-3, "{lag} {error}");
    }

    #[test]
    fn no_error_counts_for_more_than_the_largest() {
        let pll = Pll::new(4.0);
        for sign in [1.0, -1.0] {
            let most = pll.correction(sign * LARGEST_ERROR, 1.0, 0.0);
            assert_eq!(pll.correction(sign * 3.0, 1.0, 0.0), most);
            assert_ne!(pll.correction(sign * 0.59, 1.0, 0.0), most);
        }
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

    #[test]
    fn the_loop_comes_to_rest_on_the_axis() {
        let (pll, mut state, mut rotor_freq) = (Pll::new(4.0), TrackerState::default(), 0.0);
        let axis = 0.02; // turns
        for _ in 0..12_000 {
            let error = core::f32::consts::TAU * (axis - state.angle.to_turns());
            let correction = pll.correction(error, 1.0, 0.0);
            Pll::step(&mut state, &mut rotor_freq, correction, 0.0, &Turning::default());
        }
        assert!((state.angle.to_turns() - axis).abs() < 1e-4 && rotor_freq.abs() < 1e-6);
    }
}
