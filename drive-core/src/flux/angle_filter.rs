//! Kalman filter of the flux angle. The injection shows the angle, the voltage of the fundamental wave shows its rate, and each
//! is weighted by its variance.
//!
//! ```text
//! x  = (e, w, a, r, b)          w' = a      a' = noise      r' = -r/tau_s + noise      b' = -b/tau + f e + noise
//! z1 = e + n1                   once an injection period, from the saliency
//! z2 = l e + w + h r + b + n2   mean of (turned - slip) of the observer over an injection period
//! ```
//!
//! `e` is the angle error, flux less estimate, rad; `w` the electrical speed of the rotor, rad/s; `a` its rate; `r` the relative deviation
//! of the stator resistance; `b` another slow error of the observed speed, rad/s. `l` and `h` come from the
//! [observer](super::observer::SeenSpeed). An angle error adds `i_q e` to the d-axis current, so that within `tau_r` the flux grows by the
//! share `d = i_q e/i_d` above the estimated flux. Then the voltage turns the flux by the share `d` faster than the observer sees, the slip
//! is smaller by `d`, and `b` grows by `w d`. Therefore `f = k w i_q/(tau_r i_d)`. The effect on the flux decays within `tau_r`, but `b`
//! within 2 s, hence `k = 0.5`. (Without `f`, angle and flux oscillate at 1 Hz if the q-axis current is three times the d-axis current. If
//! `w` is replaced by the negative slip, which is correct at zero stator frequency, 52 of 1000 runs at up to 600 rpm lost the lock; with
//! `k = 0.2` it was 20 of 300. With `k = 1` and wrong parameters, the angle error of motors that saturate is a quarter larger.) `r` returns
//! to the resistance that the start has measured with the time constant `tau_s`, 5 s; if none was measured, it does not return. While the
//! q-axis current changes, the angle from the injection has an error (the saliency offset lags), and so has the speed from the observer
//! (the leakage is not exact). Therefore both variances grow with the largest change of the current in an injection period. During a torque
//! step, inertia and slip then determine the angle; during a load step, the voltage does. `r` is learned from torque steps: `h r` jumps,
//! and `w` cannot.
//!
//! `w`, `a` and `r` are corrections of the tracked speed, its rate and the observer's resistance, so that only `b` and the covariance
//! stay here. They are reset while the filter does not track the angle: before the frame rotates, while the observer gives the angle,
//! and while the averages of the demodulation fill.
//!
//! The work of an injection period has six parts, in six of its samples, so that none takes long: predict the flux, predict, see
//! the speed, reduce P, see the injection, reduce P. They run from the flash (`memory.x`) and are not inlined, which saves 1318
//! bytes of control code.
//!
//! Without an observer there is z1 alone. With a steady covariance, the filter is then a loop of third order with
//! Butterworth poles at `w_n = (rate noise/(variance of z1 x T))^(1/6)`.

use core::f32::consts::TAU;

use super::observer::{SeenSpeed, UNMEASURED};
use crate::PERIOD_S;
use crate::carrier::CARRIER_SAMPLES;
use crate::carrier::injection::CARRIER_S;
use crate::math::limited;

/// Number of states.
const N: usize = 5;
/// Injection period, s.
const T: f32 = CARRIER_S;
/// Clamp of the angle error that the saliency shows, rad.
const LARGEST_ERROR: f32 = 0.6;
/// Variance of the speed that is added in a second, (rad/s)^2: slip due to a change of the rotor resistance.
const SPEED_NOISE: f32 = 4.0;
/// Variance of the resistance that is added in a second: heating by 1 %.
const RESISTANCE_NOISE: f32 = 0.01 * 0.01;
/// Standard deviation of the slow error, rad/s. It is due to the slip with a wrong rotor resistance, and to the inverter voltage
/// error, a thousandth of the dc link over the flux. Motors with the same rated frequency have about the same value.
const SLOW: f32 = 1.5;
/// Share of the largest change of the current that still counts after an injection period.
const REMEMBERED: f32 = 0.7;
/// Initial standard deviations of angle, speed, its rate and slow error: rad, rad/s, rad/s^2, rad/s.
const FIRST: [f32; N - 1] = [0.1, 5.0, 100.0, SLOW];

/// Variances of the filter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AngleFilter {
    /// Variance of the rate of the speed that is added in a second, (rad/s^2)^2.
    pub rate: f32,
    /// Variance of the saliency of an injection period.
    pub saliency: f32,
    /// Error of the angle from the saliency, per change of the q-axis current in an injection period, rad/A.
    pub angle_per_a: f32,
    /// Variance of the speed that the observer sees in an injection period, (rad/s)^2.
    pub speed: f32,
    /// Error of that speed per change of the q-axis current in an injection period, rad/s/A.
    pub speed_per_a: f32,
    /// Change of the observed speed per angle error, q-axis current and speed of the rotor, `k/(tau_r i_d)`, 1/(s A).
    pub flux_by_angle: f32,
    /// Time constant of the slow error of the observed speed, s.
    pub slow_s: f32,
}

/// State of the filter.
#[derive(Clone, Copy, Debug, Default)]
pub struct AngleFilterState {
    /// Lower triangle of the covariance P, row by row. (With both triangles, each rounded separately, the covariance loses its
    /// definiteness within a minute.)
    covariance: [f32; N * (N + 1) / 2],
    /// Results of the present injection period: P h', the reciprocal variance of the innovation, and the corrections.
    ph: [f32; N],
    per_variance: f32,
    x: [f32; N],
    /// Slow error of the observed speed, rad/s.
    slow: f32,
    /// Q-axis current of the last injection period, and its largest recent change, A.
    i_q: f32,
    moved: f32,
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
    /// Resets the state. `deviation`: standard deviation of the resistance by its measurement, relative; 0 without one.
    #[cold] // in the flash
    pub fn start(&mut self, deviation: f32) {
        *self = Self { i_q: self.i_q, moved: self.moved, ..Self::default() };
        let r = if deviation > 0.0 { deviation } else { UNMEASURED };
        let [e, w, a, b] = FIRST.map(|deviation| deviation * deviation);
        self.covariance = [e, 0.0, w, 0.0, 0.0, a, 0.0, 0.0, 0.0, r * r, 0.0, 0.0, 0.0, 0.0, b];
    }

    /// Takes the q-axis current of an injection period, A.
    pub fn follow(&mut self, i_q: f32) {
        let moved = (i_q - self.i_q).abs();
        let remembered = REMEMBERED * self.moved;
        self.i_q = i_q;
        self.moved = if moved > remembered { moved } else { remembered };
    }

    /// Returns the variance of a source, from its variance at constant current and its error `per_a` per change of the current.
    fn variance(&self, at_rest: f32, per_a: f32) -> f32 {
        let moved = per_a * self.moved;
        at_rest + moved * moved
    }

    /// Part after each update by a measurement: `P -= P h' h P/variance`.
    #[inline(never)]
    pub fn reduce(&mut self) {
        let per_variance = core::mem::take(&mut self.per_variance);
        let mut covariance = self.covariance.iter_mut();
        for n in 0..N {
            let gain = self.ph[n] * per_variance;
            for (p, ph) in covariance.by_ref().take(n + 1).zip(&self.ph) {
                *p -= gain * ph;
            }
        }
    }
}

impl AngleFilter {
    /// First part of an injection period: the effect of the angle on the flux in `P = F P F'`, with a rotor speed `rotor_freq`,
    /// electrical turns per period.
    #[inline(never)]
    pub fn predict_flux(&self, state: &mut AngleFilterState, rotor_freq: f32) {
        let f = T * TAU / PERIOD_S * self.flux_by_angle * rotor_freq * state.i_q;
        let [ee, we, _, ae, _, _, re, _, _, _, be, bw, ba, br, bb] = &mut state.covariance;
        let turned = *be + f * *ee;
        *bb += f * (*be + turned);
        *be = turned;
        *bw += f * *we;
        *ba += f * *ae;
        *br += f * *re;
    }

    /// Second part: the rest of `P = F P F' + Q`. `resistance_decay` is the share by which the deviation of the resistance decays
    /// in an injection period.
    #[inline(never)]
    pub fn predict(&self, state: &mut AngleFilterState, resistance_decay: f32) {
        let kept = 1.0 - T / self.slow_s;
        let r_kept = 1.0 - resistance_decay;
        let [ee, we, ww, ae, aw, aa, re, rw, ra, rr, be, bw, ba, br, bb] = &mut state.covariance;
        *ee += T * (2.0 * *we + T * *ww);
        *we += T * (*ww + *ae + T * *aw);
        *ae += T * *aw;
        *re = r_kept * (*re + T * *rw);
        *be = kept * (*be + T * *bw);
        *ww += T * (2.0 * *aw + T * *aa + SPEED_NOISE);
        *aw += T * *aa;
        *rw = r_kept * (*rw + T * *ra);
        *ra *= r_kept;
        *bw = kept * (*bw + T * *ba);
        *aa += T * self.rate;
        *ba *= kept;
        *rr = r_kept * r_kept * *rr + T * RESISTANCE_NOISE;
        *br *= kept * r_kept;
        *bb = kept * kept * *bb + T * (2.0 / self.slow_s * SLOW * SLOW);
        state.slow *= kept;
    }

    /// Third part: update by the speed that the observer has `seen`. It is above the tracked speed by `faster`, electrical turns
    /// per period.
    #[inline(never)]
    pub fn see_speed(&self, state: &mut AngleFilterState, seen: &SeenSpeed, faster: f32) {
        let [ee, we, ww, ae, aw, _, re, rw, ra, rr, be, bw, ba, br, bb] = state.covariance;
        let (l, h) = (seen.per_angle, seen.per_resistance);
        state.ph = [
            l * ee + we + h * re + be,
            l * we + ww + h * rw + bw,
            l * ae + aw + h * ra + ba,
            l * re + rw + h * rr + br,
            l * be + bw + h * br + bb,
        ];
        let [ph_e, ph_w, _, ph_r, ph_b] = state.ph;
        let expected = l * ph_e + ph_w + h * ph_r + ph_b;
        let variance = state.variance(self.speed, self.speed_per_a);
        state.per_variance = 1.0 / (expected + variance);
        let share = (faster * (TAU / PERIOD_S) - state.slow) * state.per_variance;
        state.x = state.ph.map(|ph| ph * share);
    }

    /// Part after the first reduction: update by the angle `error`, rad, of the demodulation, where `per_saliency`,
    /// rad, is the angle for a saliency of 1. Returns the corrections, and the correction of the relative stator
    /// resistance.
    #[inline(never)]
    pub fn see_carrier(
        &self,
        state: &mut AngleFilterState,
        error: f32,
        per_saliency: f32,
    ) -> (Correction, f32) {
        let [ee, we, _, ae, _, _, re, _, _, _, be, ..] = state.covariance;
        state.ph = [ee, we, ae, re, be];
        let variance =
            state.variance(self.saliency * per_saliency * per_saliency, self.angle_per_a);
        state.per_variance = 1.0 / (ee + variance);
        let x = core::mem::take(&mut state.x);
        let share = (limited(error, LARGEST_ERROR) - x[0]) * state.per_variance;
        let [e, w, a, resistance, b] = core::array::from_fn(|n| x[n] + state.ph[n] * share);
        state.slow += b;
        const PER_RADIAN: f32 = 1.0 / (TAU * CARRIER_SAMPLES as f32);
        let correction = Correction {
            angle: PER_RADIAN * e,
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

    /// Filter for the dissertation's motor at 1.4 A.
    const FILTER: AngleFilter = AngleFilter {
        rate: 26.5e3,
        saliency: 5.2e-5,
        angle_per_a: 0.1,
        speed: 4.1,
        speed_per_a: 14.4,
        flux_by_angle: 1.95,
        slow_s: 2.0,
    };
    const PER_SALIENCY: f32 = -14.3;
    /// Rotor speed: -300 rpm, generating.
    const ROTOR_FREQ: f32 = -10.0 * PERIOD_S;
    const RESISTANCE_DECAY: f32 = T / 5.0;

    fn seen(per_angle: f32, per_resistance: f32) -> SeenSpeed {
        SeenSpeed { rotor_freq: 0.0, age: 0.0, per_angle, per_resistance }
    }

    impl AngleFilter {
        /// Runs a whole injection period.
        fn step(
            &self,
            state: &mut AngleFilterState,
            error: f32,
            per_saliency: f32,
            seen: Option<(&SeenSpeed, f32)>,
        ) -> (Correction, f32) {
            self.predict_flux(state, ROTOR_FREQ);
            self.predict(state, RESISTANCE_DECAY);
            if let Some((seen, faster)) = seen {
                self.see_speed(state, seen, faster);
            }
            state.reduce();
            let corrections = self.see_carrier(state, error, per_saliency);
            state.reduce();
            corrections
        }
    }

    fn started() -> AngleFilterState {
        let mut state = AngleFilterState { i_q: 1.5, ..AngleFilterState::default() };
        state.start(0.03);
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
        let p = Matrix::from_fn(|n, m| {
            f64::from(state.covariance[n.max(m) * (n.max(m) + 1) / 2 + n.min(m)])
        });
        assert!(p.cholesky().is_some(), "{p}");
        p
    }

    /// Runs one injection period of the filter in double precision with the Joseph form of the update, whose covariance stays
    /// definite.
    fn reference(p: Matrix, seen: Option<&SeenSpeed>, k: f64) -> (Matrix, [f64; N]) {
        let t = f64::from(T);
        let mut f = Matrix::identity();
        (f[(0, 1)], f[(1, 2)], f[(4, 4)]) = (t, t, 1.0 - t / f64::from(FILTER.slow_s));
        f[(3, 3)] = 1.0 - f64::from(RESISTANCE_DECAY);
        let mut flux = Matrix::identity();
        let w = f64::from(ROTOR_FREQ * TAU / PERIOD_S);
        flux[(4, 0)] = t * f64::from(FILTER.flux_by_angle) * w * 1.5;
        let f = f * flux;
        let slow = 2.0 / f64::from(FILTER.slow_s) * f64::from(SLOW).powi(2);
        let noise = [0.0, f64::from(SPEED_NOISE), f64::from(FILTER.rate), 0.01 * 0.01, slow];
        let mut p = f * p * f.transpose()
            + Matrix::from_diagonal(&(t * nalgebra::SVector::<f64, N>::from(noise)));
        let mut gain = [0.0; N];
        let carrier = ([1.0, 0.0, 0.0, 0.0, 0.0], f64::from(FILTER.saliency) * k * k);
        let speed = seen.map(|seen| {
            let [l, h] = [seen.per_angle, seen.per_resistance].map(f64::from);
            ([l, 1.0, 0.0, h, 1.0], f64::from(FILTER.speed))
        });
        for (h, r) in [speed, Some(carrier)].into_iter().flatten() {
            let h = nalgebra::RowSVector::<f64, N>::from(h);
            let k = p * h.transpose() / ((h * p * h.transpose())[0] + r);
            let rest = Matrix::identity() - k * h;
            p = rest * p * rest.transpose() + k * r * k.transpose();
            gain = k.into();
        }
        (p, gain)
    }

    /// Runs a million injection periods, half an hour, in f32: at constant torque without a rotating flux, with the flux of a
    /// drive that reverses, and without an observer. (When the two halves of the covariance were computed separately, it lost its
    /// definiteness after 45 s.)
    #[test]
    fn the_covariance_stays_definite_for_a_million_carrier_periods() {
        for case in 0..3 {
            let (mut state, mut seed, mut speed) = (started(), 7_u32, 0.0_f32);
            for n in 0..1_000_000 {
                let (l, h) = match case {
                    0 => (0.0, 50.0),
                    _ => {
                        speed += 0.5 * noise(&mut seed) - 1e-3 * speed;
                        (6.0 * speed.abs(), 20.0 - speed)
                    }
                };
                state.follow(if n % 3000 < 1500 || case == 0 { 2.0 } else { -2.0 });
                let seen = seen(l, h);
                let faster = 1e-4 * noise(&mut seed);
                let faster = (case < 2).then_some((&seen, faster));
                let (x, resistance) =
                    FILTER.step(&mut state, 0.1 * noise(&mut seed), PER_SALIENCY, faster);
                assert!((x.angle + x.speed + x.acceleration + resistance).is_finite());
                if n % 1000 == 0 {
                    covariance(&state);
                }
            }
        }
    }

    /// Steady covariances equal those of the filter in double precision, for stator frequencies from 0 to 16 Hz, and the gains
    /// are those of filter theory.
    #[test]
    fn the_steady_covariance_is_that_of_double_precision() {
        for (l, h) in [(0.0, 50.0), (18.0, 1.0), (35.0, -11.0), (86.0, 18.0)] {
            let mut state = started();
            let mut p = covariance(&state);
            let seen = seen(l, h);
            for _ in 0..60_000 {
                FILTER.step(&mut state, 0.0, PER_SALIENCY, Some((&seen, 0.0)));
                p = reference(p, Some(&seen), PER_SALIENCY.into()).0;
            }
            let found = covariance(&state);
            for n in 0..N {
                let deviation = (found[(n, n)] / p[(n, n)] - 1.0).abs();
                assert!(deviation < 0.01, "{l} {h} {n}: {deviation}");
            }
        }
    }

    /// Without an observer the filter has Butterworth poles: the gains of an injection period are 2 w T, 2 w^2 T
    /// and w^3 T, and the second is a tenth larger because of the noise of the speed.
    #[test]
    fn the_carrier_alone_tracks_with_the_poles_of_butterworth() {
        let (w, mut state) = (core::f32::consts::TAU * 3.5, started());
        let variance = FILTER.saliency * PER_SALIENCY * PER_SALIENCY;
        let filter = AngleFilter { rate: variance * T * w.powi(6), ..FILTER };
        for _ in 0..6000 {
            filter.step(&mut state, 0.0, PER_SALIENCY, None);
        }
        let p = state.covariance;
        // The gain of an update is P after it over the variance.
        let gains = [p[0], p[1], p[3]].map(|p| p / variance / T);
        for (gain, expected) in gains.into_iter().zip([2.0 * w, 2.0 * w * w, w * w * w]) {
            assert!((gain / expected - 1.0).abs() < 0.12, "{gain} for {expected}");
        }
    }

    /// An angle error beyond the clamp counts as much as one at the clamp, and a saliency counts less while the current changes.
    #[test]
    fn large_errors_and_moving_currents_count_less() {
        let after = |error: f32, amperes: f32| {
            let mut state = AngleFilterState { i_q: 0.0, ..started() };
            state.follow(amperes);
            FILTER.step(&mut state, error, PER_SALIENCY, None).0.angle
        };
        assert_eq!(after(0.6, 0.0), after(3.0, 0.0));
        assert_eq!(after(-0.6, 0.0), after(-9.0, 0.0));
        assert!(after(0.59, 0.0) < after(0.6, 0.0));
        assert!(after(0.1, 3.0) < 0.2 * after(0.1, 0.0));
        let mut state = AngleFilterState { i_q: 0.0, ..started() };
        for i_q in [0.0, 1.0, 1.0, 1.0] {
            state.follow(i_q);
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
                state.follow(i_q);
                let seen = seen(0.0, 25.0 * i_q);
                tracked += T * rate;
                let speed = w + 25.0 * i_q * (r - believed) + 1.7 * noise(&mut seed);
                let faster = (speed - tracked) * (PERIOD_S / TAU);
                let (x, resistance) =
                    FILTER.step(&mut state, 0.0, PER_SALIENCY, Some((&seen, faster)));
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
