//! Kalman filter of the flux angle. The injection shows the angle, the voltage of the fundamental wave shows its rate, and each
//! is weighted by its variance.
//!
//! ```text
//! x  = (e, w, a, r, b, d)
//! e' = w - alpha e - s d      d' = s e - delta d + noise      w' = a + noise      a' = noise
//! r' = -r/tau_s + noise       b' = -b/tau + noise
//! z1 = e + n1                 once an injection period, from the saliency
//! z2 = (g w_r^2 - alpha) e + w + h r + b + w_r (1 + g delta) d + n2
//!                             mean of (turned - slip) of the observer over an injection period
//! ```
//!
//! `e` is the angle error, flux less estimate, rad; `w` the error of the tracked electrical speed of the rotor, rad/s; `a` that of its
//! rate; `r` the relative deviation of the stator resistance; `b` another slow error of the observed speed, rad/s; `d` the
//! relative error of the length of the flux, flux less estimate.
//!
//! `e` and `d` follow from the rotor equation in a frame whose currents are regulated, with `alpha = 1/tau_r` and the slip
//! `s = alpha i_q/i_d`, linearised: `psi' = R_R i - (alpha + j (w_s - w_r)) psi` with `psi = psi_0 (1 + d) (1 + j e)`. A change of the
//! length decays by `delta`, which is larger than alpha by the ratio of the chord inductance to the incremental one: iron that saturates
//! lets the flux grow less. In `z2`, a longer flux induces more voltage, which is observed as a higher speed; the pull of the observer
//! towards its current model, with the gain `g`, adds the rest; `h` comes from the [observer](super::observer::SpeedWeights). (A filter
//! with `e' = w` alone, whose `b` took up the effect of the flux, lost motors that cross zero frequency while they generate, where
//! `i_q/i_d` is above 2.)
//!
//! `r` returns to the resistance that the start has measured with the time constant `tau_s`, 5 s; if none was measured, it does not
//! return. While the q-axis current changes, the angle from the injection has an error (the saliency offset lags), and so has the speed
//! from the observer (the leakage is not exact). Therefore both variances grow with the largest change of the current in an injection
//! period. During a torque step, inertia and slip then determine the angle; during a load step, the voltage does. `r` is learned from
//! torque steps: `h r` jumps, and `w` cannot.
//!
//! `w`, `a` and `r` are corrections of the tracked speed, its rate and the observer's resistance, so that only `b`, `d` and the
//! covariance stay here. They are reset while the filter does not track the angle: before the frame rotates, while the observer gives
//! the angle, and while the averages of the demodulation fill.
//!
//! Every injection period both measurements correct the state. Behind each speed the covariance is reduced, and a speed therefore has the
//! gain of a Kalman filter. To save time, the covariance is predicted once in two injection periods, and in the other one it is reduced by
//! both angles together. Until then the gain of an angle is `P h'/(variance (1 + h P h' sum))`, with the sum of the information
//! `1/variance`. A reduction behind each angle would give the same gain. (An earlier form reduced the covariance by two speeds together
//! and weighed them before the prediction: after a load step the gain of a speed was a third of the right one.) The work is done in
//! parts, in several samples, so that none takes long. They run from the flash (`memory.x`) and are not inlined there, because inlined
//! they would lie in the control memory.
//!
//! Without an observer there is z1 alone, and the rotor equation is left out. With a steady covariance, the filter is then a
//! loop of third order with Butterworth poles at `w_n = (rate noise/(variance of z1 x T))^(1/6)`.

use core::f32::consts::TAU;

use super::covariance::{Covariance, N, Weights};
use super::observer::{SpeedWeights, UNMEASURED};
use crate::PERIOD_S;
use crate::carrier::CARRIER_SAMPLES;
use crate::carrier::injection::CARRIER_S;
use crate::math::limited;

/// Places of the states.
const E: usize = 0;
const W: usize = 1;
const A: usize = 2;
const R: usize = 3;
const B: usize = 4;
const D: usize = 5;
/// Injection period, s.
const T: f32 = CARRIER_S;
/// Injection periods between two predictions of the covariance.
const PERIODS: f32 = 2.0;
const SPAN: f32 = AngleFilter::SPAN_S;
/// Clamp of the angle error that the saliency shows, rad.
const LARGEST_ERROR: f32 = 0.6;
/// Largest angle by which the slip turns the flux between two predictions, rad.
const LARGEST_SLIP: f32 = 1.0;
/// Variance of the resistance that is added in a second: heating by 1 %.
const RESISTANCE_NOISE: f32 = 0.01 * 0.01;
/// Standard deviation of the length of the flux, relative, beyond what the rotor equation explains.
const GROWTH: f32 = 0.015;
/// Share of the largest change of the current that still counts after an injection period.
const REMEMBERED: f32 = 0.7;
/// Initial standard deviations of angle, speed, its rate and flux: rad, rad/s, rad/s^2, relative.
const FIRST: [f32; 4] = [0.1, 5.0, 100.0, GROWTH];

/// Variances of the filter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AngleFilter {
    /// Variance of the rate of the speed that is added in a second, (rad/s^2)^2.
    pub rate: f32,
    /// Variance of the speed that is added in a second, (rad/s)^2.
    pub slip: f32,
    /// Variance of the saliency of an injection period.
    pub saliency: f32,
    /// Error of the angle from the saliency, per change of the q-axis current in an injection period, rad/A.
    pub angle_per_a: f32,
    /// Variance of the speed that the observer sees in an injection period, (rad/s)^2.
    pub speed: f32,
    /// Error of that speed per change of the q-axis current in an injection period, rad/s/A.
    pub speed_per_a: f32,
    /// Shares of an error of the angle and of the length of the flux that the rotor equation keeps over [`SPAN_S`](Self::SPAN_S),
    /// `exp(-alpha SPAN_S)` and `exp(-delta SPAN_S)`; 1 without an observer.
    pub kept: [f32; 2],
    /// Rate `delta` by which a change of the length of the flux decays, 1/s, at least alpha; 0 without an observer.
    pub delta: f32,
    /// Variance of the slow error of the observed speed, (rad/s)^2, and the rate by which it decays, 1/s.
    pub slow: f32,
    pub slow_rate: f32,
}

/// State of the filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct AngleFilterState {
    covariance: Covariance,
    /// Whether the covariance is predicted in this injection period; otherwise it is reduced by the angles.
    pub predicts: bool,
    /// Weights of the latest measurement.
    weights: Weights,
    /// Information of the angles and of the speed by which the covariance is not reduced yet.
    angles: f32,
    speed: f32,
    /// Corrections by the latest speed.
    x: [f32; N],
    /// Slow error of the observed speed, rad/s, and relative deviation of the flux.
    slow: f32,
    grown: f32,
    /// Speed above the tracked one that both let the observer see, rad/s.
    expected: f32,
    /// Q-axis current of the last injection period, and its largest recent change, A.
    i_q: f32,
    pub moved: f32,
    /// Slip, rad in an injection period.
    slip: f32,
}

/// Corrections of a period.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Correction {
    /// Angle, electrical turns.
    pub angle: f32,
    /// Speed, electrical turns per period.
    pub speed: f32,
    /// Acceleration, electrical turns per period squared.
    pub acceleration: f32,
}

impl AngleFilterState {
    /// Takes the q-axis current of an injection period, A, and the slip, electrical turns per period.
    pub fn follow(&mut self, i_q: f32, slip_freq: f32) {
        let moved = (i_q - self.i_q).abs();
        let remembered = REMEMBERED * self.moved;
        self.i_q = i_q;
        self.moved = if moved > remembered { moved } else { remembered };
        self.slip = limited(slip_freq * (TAU * CARRIER_SAMPLES as f32), LARGEST_SLIP / PERIODS);
    }

    /// Returns the information of a measurement, from its variance at constant current and its error `per_a` per change of the
    /// current.
    fn information(&self, at_rest: f32, per_a: f32) -> f32 {
        let moved = per_a * self.moved;
        1.0 / (at_rest + moved * moved)
    }

    /// Part behind the speed of the observer: reduces the covariance by it.
    pub fn reduce(&mut self) {
        self.covariance.reduce(&self.weights, core::mem::take(&mut self.speed));
    }
}

impl AngleFilter {
    /// Time between two predictions of the covariance, s.
    pub const SPAN_S: f32 = PERIODS * T;

    /// Resets the state. `deviation`: standard deviation of the resistance by its measurement, relative; 0 without one.
    #[cold] // in the flash
    pub fn start(&self, state: &mut AngleFilterState, deviation: f32) {
        let AngleFilterState { i_q, moved, slip, .. } = *state;
        let [e, w, a, d] = FIRST.map(|deviation| deviation * deviation);
        let r = if deviation > 0.0 { deviation } else { UNMEASURED };
        let covariance = Covariance::of([e, w, a, r * r, self.slow, d]);
        *state = AngleFilterState { i_q, moved, slip, covariance, ..AngleFilterState::default() };
    }

    /// Part behind the corrections: the rotor equation in `P = F P F' + Q`, or the reduction by the angles.
    #[inline(never)]
    pub fn turn(&self, state: &mut AngleFilterState) {
        state.predicts = !state.predicts;
        if !state.predicts {
            let information = core::mem::take(&mut state.angles);
            return state.covariance.reduce(&state.weights, information);
        }
        if self.delta == 0.0 {
            return; // without an observer
        }
        // The rotor equation: a rotation by two shears, which keep the area, then the decay.
        let (turn, p) = (PERIODS * state.slip, &mut state.covariance);
        p.add::<E, D>(-turn);
        p.add::<D, E>(turn);
        let [angle, length] = self.kept;
        p.keep::<E>(angle, 0.0);
        p.keep::<D>(length, (1.0 - length * length) * (GROWTH * GROWTH));
    }

    /// Part behind that one: the rest of `P = F P F' + Q`. `resistance_decay` is the share by which the deviation of the resistance
    /// decays in an injection period.
    #[inline(never)]
    pub fn predict(&self, state: &mut AngleFilterState, resistance_decay: f32) {
        if !state.predicts {
            return;
        }
        let p = &mut state.covariance;
        p.add::<E, W>(SPAN);
        p.add::<W, A>(SPAN);
        p.keep::<W>(1.0, SPAN * self.slip);
        p.keep::<A>(1.0, SPAN * self.rate);
        p.keep::<R>(1.0 - PERIODS * resistance_decay, SPAN * RESISTANCE_NOISE);
        let decay = SPAN * self.slow_rate;
        p.keep::<B>(1.0 - decay, 2.0 * decay * self.slow);
    }

    /// Part before the speed of the observer: its weights.
    #[inline(never)]
    pub fn weigh_speed(&self, state: &mut AngleFilterState, seen: &SpeedWeights) {
        let longer = seen.speed + seen.pull * self.delta;
        let (a, r, p) = (seen.per_angle, seen.per_resistance, &state.covariance);
        let [pe, pw, pr, pb, pd] =
            [p.row::<E>(), p.row::<W>(), p.row::<R>(), p.row::<B>(), p.row::<D>()];
        let x = core::array::from_fn(|n| a * pe[n] + pw[n] + r * pr[n] + pb[n] + longer * pd[n]);
        let explained = a * x[E] + x[W] + r * x[R] + x[B] + longer * x[D];
        state.weights = Weights { states: x, explained };
        state.expected = state.slow + longer * state.grown;
    }

    /// Part in the last sample: update by the speed that the observer has seen. It is above the tracked speed by `faster`, electrical
    /// turns per period.
    #[inline(never)]
    pub fn see_speed(&self, state: &mut AngleFilterState, faster: f32) {
        let information = state.information(self.speed, self.speed_per_a);
        state.speed = information;
        let innovation = faster * (TAU / PERIOD_S) - state.expected;
        let share = innovation * information / (1.0 + state.weights.explained * information);
        state.x = state.weights.states.map(|weight| weight * share);
    }

    /// Part in the middle: update by the angle `error`, rad, of the demodulation, where `per_saliency`, rad, is the angle for a
    /// saliency of 1. Returns the corrections, and the correction of the relative stator resistance.
    #[inline(never)]
    pub fn see_carrier(
        &self,
        state: &mut AngleFilterState,
        error: f32,
        per_saliency: f32,
    ) -> (Correction, f32) {
        const PER_RADIAN: f32 = 1.0 / (TAU * CARRIER_SAMPLES as f32);
        let states = state.covariance.row::<E>();
        state.weights = Weights { states, explained: states[E] };
        let at_rest = self.saliency * per_saliency * per_saliency;
        let information = state.information(at_rest, self.angle_per_a);
        state.angles += information;
        let (x, weights) = (core::mem::take(&mut state.x), &state.weights);
        let innovation = limited(error, LARGEST_ERROR) - x[E];
        let share = innovation * information / (1.0 + weights.explained * state.angles);
        let [e, w, a, resistance, b, d] =
            core::array::from_fn(|n| x[n] + weights.states[n] * share);
        state.slow = (1.0 - T * self.slow_rate) * state.slow + b;
        state.grown = (1.0 - T * self.delta) * state.grown + d;
        let correction = Correction {
            angle: PER_RADIAN * (e - state.slip * state.grown),
            speed: PER_RADIAN * PERIOD_S * w,
            acceleration: PER_RADIAN * PERIOD_S * PERIOD_S * a,
        };
        (correction, resistance)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_methods)] // std functions are the reference here
    use super::*;
    use crate::flux::covariance::place;

    /// Filter for the dissertation's motor at 1.4 A.
    const FILTER: AngleFilter = AngleFilter {
        rate: 26.5e3,
        slip: 4.0,
        saliency: 5.2e-5,
        angle_per_a: 0.1,
        speed: 4.1,
        speed_per_a: 14.4,
        kept: [0.982_161, 0.964_640],
        delta: 10.8,
        slow: 2.25,
        slow_rate: 0.5,
    };
    /// Rate of the rotor, 1/s.
    const ALPHA: f32 = 5.4;
    const PER_SALIENCY: f32 = -14.3;
    /// Slip, electrical turns per period, at 1.5 A.
    const SLIP_FREQ: f32 = ALPHA * 1.5 / 1.4 * PERIOD_S / TAU;
    const RESISTANCE_DECAY: f32 = T / 5.0;

    impl AngleFilter {
        /// Runs a whole injection period, with the angle `error` that the saliency shows without load.
        fn step(
            &self,
            state: &mut AngleFilterState,
            error: f32,
            seen: Option<(&SpeedWeights, f32)>,
        ) -> (Correction, f32) {
            let corrections = self.see_carrier(state, error, PER_SALIENCY);
            self.turn(state);
            self.predict(state, RESISTANCE_DECAY);
            if let Some((weights, faster)) = seen {
                self.weigh_speed(state, weights);
                self.see_speed(state, faster);
            }
            state.reduce();
            corrections
        }
    }

    fn started() -> AngleFilterState {
        let mut state = AngleFilterState { i_q: 1.5, ..AngleFilterState::default() };
        state.follow(1.5, SLIP_FREQ);
        FILTER.start(&mut state, 0.03);
        state
    }

    /// Returns noise of variance 1/3.
    fn noise(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    type Matrix = nalgebra::SMatrix<f64, N, N>;

    /// Returns the covariance. The Cholesky decomposition in double precision shows that it is positive definite.
    fn covariance(state: &AngleFilterState) -> Matrix {
        let p = Matrix::from_fn(|n, m| f64::from(state.covariance.0[place(n, m)]));
        assert!(p.cholesky().is_some(), "{p}");
        p
    }

    /// Runs two injection periods of the filter in double precision, with the Joseph form of each update, whose covariance stays definite.
    fn reference(p: Matrix, weights: &SpeedWeights) -> Matrix {
        let (span, alpha) = (f64::from(SPAN), f64::from(ALPHA));
        let delta = f64::from(FILTER.delta);
        let slip = f64::from(SLIP_FREQ * TAU / PERIOD_S);
        // The rotor equation as the exponential of its matrix, then the rest.
        let (mut rotor, mut rest) = (Matrix::identity(), Matrix::identity());
        let (kept, turn) = ((-alpha * span).exp(), slip * span);
        (rotor[(0, 0)], rotor[(0, 5)]) = (kept * turn.cos(), -kept * turn.sin());
        let kept = (-delta * span).exp();
        (rotor[(5, 0)], rotor[(5, 5)]) = (kept * turn.sin(), kept * turn.cos());
        (rest[(0, 1)], rest[(1, 2)]) = (span, span);
        (rest[(3, 3)], rest[(4, 4)]) = (1.0 - span / 5.0, 1.0 - span * f64::from(FILTER.slow_rate));
        let f = rest * rotor;
        let growth = (1.0 - (-2.0 * delta * span).exp()) / span * f64::from(GROWTH).powi(2);
        let slow = 2.0 * f64::from(FILTER.slow_rate) * f64::from(FILTER.slow);
        let noise =
            [0.0, f64::from(FILTER.slip), f64::from(FILTER.rate), 0.01 * 0.01, slow, growth];
        let mut p = f * p * f.transpose()
            + Matrix::from_diagonal(&(span * nalgebra::SVector::<f64, N>::from(noise)));
        let [l, h] = [weights.per_angle, weights.per_resistance].map(f64::from);
        let g = f64::from(weights.speed + weights.pull * FILTER.delta);
        let at_rest = f64::from(FILTER.saliency * PER_SALIENCY * PER_SALIENCY);
        let carrier = ([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], at_rest);
        let speed = ([l, 1.0, 0.0, h, 1.0, g], f64::from(FILTER.speed));
        for (h, r) in [speed, carrier, carrier, speed] {
            let h = nalgebra::RowSVector::<f64, N>::from(h);
            let k = p * h.transpose() / ((h * p * h.transpose())[0] + r);
            let rest = Matrix::identity() - k * h;
            p = rest * p * rest.transpose() + k * r * k.transpose();
        }
        p
    }

    fn weights(per_angle: f32, per_resistance: f32, speed: f32) -> SpeedWeights {
        SpeedWeights { per_angle, per_resistance, speed, pull: 0.02 * speed }
    }

    /// Runs a million injection periods, half an hour, in f32: at constant torque without a rotating flux, with the flux of a
    /// drive that reverses, and without an observer. (When the two halves of the covariance were computed separately, it lost its
    /// definiteness after 45 s.)
    #[test]
    fn the_covariance_stays_definite_for_a_million_carrier_periods() {
        for case in 0..3 {
            let (mut state, mut seed, mut speed) = (started(), 7_u32, 0.0_f32);
            for n in 0..1_000_000 {
                let weights = match case {
                    0 => weights(0.0, 50.0, 0.0),
                    _ => {
                        speed += 0.5 * noise(&mut seed) - 1e-3 * speed;
                        weights(6.0 * speed.abs(), 20.0 - speed, 3.0 * speed)
                    }
                };
                let i_q = if n % 3000 < 1500 || case == 0 { 2.0 } else { -2.0 };
                state.follow(i_q, SLIP_FREQ * i_q);
                let faster = 1e-4 * noise(&mut seed);
                let faster = (case < 2).then_some((&weights, faster));
                let (x, resistance) = FILTER.step(&mut state, 0.1 * noise(&mut seed), faster);
                assert!((x.angle + x.speed + x.acceleration + resistance).is_finite());
                if n % 1000 == 0 {
                    covariance(&state);
                }
            }
        }
    }

    /// Steady covariances equal those of the filter in double precision, for speeds of the rotor from -16 to 16 Hz.
    #[test]
    fn the_steady_covariance_is_that_of_double_precision() {
        for (l, h, g) in
            [(0.0, 50.0, -6.0), (18.0, 1.0, 20.0), (35.0, -11.0, -40.0), (86.0, 18.0, 100.0)]
        {
            let (mut state, weights) = (started(), weights(l, h, g));
            let mut p = covariance(&state);
            for _ in 0..30_000 {
                for _ in 0..2 {
                    FILTER.step(&mut state, 0.0, Some((&weights, 0.0)));
                }
                p = reference(p, &weights);
            }
            // The last period of a pair predicts; the reduction belongs to the one before.
            while state.predicts {
                FILTER.step(&mut state, 0.0, Some((&weights, 0.0)));
            }
            let found = covariance(&state);
            for n in 0..N {
                let deviation = (found[(n, n)] / p[(n, n)] - 1.0).abs();
                assert!(deviation < 0.01, "{l} {h} {n}: {deviation}");
            }
        }
    }

    /// The first angles behind a start count as in a filter that reduces its covariance behind each: their mean is taken.
    #[test]
    fn measurements_of_one_span_are_weighed_one_behind_the_other() {
        let filter = AngleFilter { rate: 0.0, kept: [1.0; 2], delta: 0.0, ..FILTER };
        let mut state = started();
        let expected = |n: f32| {
            let r = filter.saliency * PER_SALIENCY * PER_SALIENCY;
            0.01 / (r + n * 0.01)
        };
        for n in 1..=2_u8 {
            let (x, _) = filter.see_carrier(&mut state, 0.1, PER_SALIENCY);
            let share = x.angle * TAU * CARRIER_SAMPLES as f32 / 0.1;
            assert!((share / expected(n.into()) - 1.0).abs() < 1e-3, "{n}: {share}");
        }
    }

    /// Without an observer the filter has Butterworth poles: the gains of an injection period are 2 w T, 2 w^2 T
    /// and w^3 T, and the second is a tenth larger because of the noise of the speed.
    #[test]
    fn the_carrier_alone_tracks_with_the_poles_of_butterworth() {
        let (w, mut state) = (core::f32::consts::TAU * 3.5, started());
        let variance = FILTER.saliency * PER_SALIENCY * PER_SALIENCY;
        let filter =
            AngleFilter { rate: variance * T * w.powi(6), kept: [1.0; 2], delta: 0.0, ..FILTER };
        for _ in 0..6000 {
            filter.step(&mut state, 0.0, None);
        }
        assert!(!state.predicts);
        let p = state.covariance.0;
        // The gain of an update is P after it over the variance.
        let gains = [p[0], p[1], p[3]].map(|p| p / variance / T);
        for (gain, expected) in gains.into_iter().zip([2.0 * w, 2.0 * w * w, w * w * w]) {
            assert!((gain / expected - 1.0).abs() < 0.12, "{gain} for {expected}");
        }
    }

    /// A flux that lasts at an angle error has grown by the slip over its time constant, and the filter finds both: angle and length of
    /// a simulated flux, while the rotor keeps its speed.
    #[test]
    fn angle_and_growth_of_a_flux_are_found() {
        let (mut state, slip) = (started(), SLIP_FREQ * TAU / PERIOD_S);
        let (mut e, mut d, w) = (0.1_f32, -0.03_f32, -20.0_f32);
        let weights = weights(-ALPHA, 0.0, w);
        for n in 0..600 {
            let (x, _) = FILTER.step(&mut state, e, Some((&weights, 0.0)));
            let slower = x.angle * TAU * CARRIER_SAMPLES as f32;
            let longer = w * (1.0 + 0.02 * FILTER.delta) * d;
            let speed = (longer - ALPHA * e) * (PERIOD_S / TAU);
            FILTER.weigh_speed(&mut state, &weights);
            FILTER.see_speed(&mut state, speed);
            state.reduce();
            (e, d) =
                (e - slower - T * (ALPHA * e + slip * d), d + T * (slip * e - FILTER.delta * d));
            if n == 30 {
                assert!(
                    e.abs() < 0.03 && (d - state.grown).abs() < 0.02,
                    "{e} {d} {}",
                    state.grown
                );
            }
        }
        assert!(e.abs() < 2e-3 && d.abs() < 2e-3, "{e} {d}");
    }

    /// An angle error beyond the clamp counts as much as one at the clamp, and a saliency counts less while the current changes.
    #[test]
    fn large_errors_and_moving_currents_count_less() {
        let after = |error: f32, amperes: f32| {
            let mut state = AngleFilterState { i_q: 0.0, ..started() };
            state.follow(amperes, 0.0);
            FILTER.step(&mut state, error, None).0.angle
        };
        assert_eq!(after(0.6, 0.0), after(3.0, 0.0));
        assert_eq!(after(-0.6, 0.0), after(-9.0, 0.0));
        assert!(after(0.59, 0.0) < after(0.6, 0.0));
        assert!(after(0.1, 3.0) < 0.2 * after(0.1, 0.0));
        let mut state = AngleFilterState { i_q: 0.0, ..started() };
        for i_q in [0.0, 1.0, 1.0, 1.0] {
            state.follow(i_q, 0.0);
        }
        assert!((state.moved - REMEMBERED * REMEMBERED).abs() < 1e-6);
    }

    /// A resistance that is 10 % higher than estimated shows only as a jump of the observed speed with the q-axis current. The
    /// filter learns it from torque steps and does not mistake a load step for it.
    #[test]
    fn torque_steps_teach_the_resistance_and_load_steps_do_not() {
        let found = |steps: bool, r: f32| {
            let (mut state, mut seed, mut believed, mut w) = (started(), 3_u32, 0.0_f32, 0.0_f32);
            let (mut tracked, mut rate) = (0.0_f32, 0.0_f32);
            for n in 0..3000 {
                let i_q = if steps && n % 600 >= 300 { -2.0 } else { 2.0 };
                let loaded = !steps && n % 600 >= 300;
                w += T * if loaded { -100.0 } else { 100.0 };
                state.follow(i_q, 0.0);
                let weights = weights(0.0, 25.0 * i_q, 0.0);
                tracked += T * rate;
                let speed = w + 25.0 * i_q * (r - believed) + 1.7 * noise(&mut seed);
                let faster = (speed - tracked) * (PERIOD_S / TAU);
                let (x, resistance) = FILTER.step(&mut state, 0.0, Some((&weights, faster)));
                tracked += x.speed * 10.0 * TAU / PERIOD_S;
                rate += x.acceleration * 10.0 * TAU / (PERIOD_S * PERIOD_S);
                believed += resistance;
            }
            believed
        };
        for r in [0.1, -0.1] {
            assert!((found(true, r) - r).abs() < 0.03, "{}", found(true, r));
        }
        assert!(found(false, 0.0).abs() < 0.03, "{}", found(false, 0.0));
    }
}
