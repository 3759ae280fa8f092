//! Back-EMF observer: rotor flux from the voltage of the fundamental wave, by a reduced-order observer that takes
//! over from the injection at speed.
//!
//! The model is the inverse-gamma circuit with `k = L_m/L_r`: `R_R = k^2 r_r`, `L_M = k L_m`, `alpha = 1/tau_r`,
//! `psi = k |psi_r|`. The flux is represented by the angle of the [estimator](super::estimator) and by a length; the frame lies
//! along it. From the difference `di` of two currents and the voltage between them,
//!
//! ```text
//! e   = T (v - r_s i) - sigma L_s ((n + m |i|) di - s conj(di))      s = a f(psi) + b i^2/|i|
//! eps = T (R_R i_d - alpha psi) - e_d
//! g   = 2 (s_0 alpha + c |w_r|)/(alpha^2 + w_r^2)
//! x   = (e_q + g w_r eps)/(psi + e_d + g alpha eps)                  turned = x - x^3/3
//! ```
//!
//! `s` is the saliency that the injection sees, as it affects the fundamental wave: without it the angle is off by 7 degrees. `n + m |i|`
//! is the leakage of the fundamental wave relative to sigma L_s, which [`commission`](crate::commission) measures. The gain is that of
//! Hinkkanen, Harnefors and Luomi (IEEE Trans. Power Electron. 25(5), 2010) with equal gains, for which the speed of the rotor cancels. The
//! length follows the current model while the injection gives the angle, and the voltage while the observer leads.
//!
//! The current is taken before the low-pass filter, less the expected injection current. The part of the injection current that
//! is due to the saliency turns the flux by 0.2 degrees at 600 Hz, which the mean over an injection period removes. (With the
//! current after the filter, a torque step turns the flux by 7 degrees more, because the voltage does not pass the filter.)
//!
//! Errors of the parameters cause errors of the angle (simulated, 0.7 A of d-axis current). If the stator resistance is off by 20 %,
//! the angle is off by 7 degrees at 300 rpm and by 1.2 degrees at 1800 rpm. If the leakage is off by 20 %, the angle is off by 12
//! degrees at any speed. Therefore the [filter](super::angle_filter) tracks the resistance with the angle, and the leakage must be
//! right within 3 %.

use core::f32::consts::TAU;

use crate::carrier::injection::CARRIER_S;
use crate::learned::Learned;
use crate::math::{limited, within};
use crate::{AlphaBeta, Dq, Motor, PERIOD_S, UnitVector};

/// Gains `s_0` and `c`. Values of `c` from 0.2 to 0.7 differ by 0.1 degrees.
const GAIN_AT_STANDSTILL: f32 = 1.0;
const GAIN_PER_SPEED: f32 = 0.4;
/// Largest turn of the flux in a period, as a tangent.
const LARGEST_TANGENT: f32 = 0.5;
/// Least flux, as a share of the nominal one.
const LEAST_FLUX: f32 = 0.01;
/// Accepted range of the stator resistance relative to the settings.
const RESISTANCE: (f32, f32) = (0.6, 1.6);
/// Least flux that shows an angle and a speed, as a share of the nominal one.
const LEAST_FLUX_SHARE: f32 = 0.6;
/// Mean age of the ten turns of an injection period in its last sample, plus the period until the tracked speed belongs to the
/// next sample, samples.
const SEEN_AGE: f32 = 5.5;
/// Time constant with which a deviation from a measured resistance decays, s. Without this decay, a lasting error of the observed
/// speed is attributed to the resistance, even if the resistance has hardly any effect. In a slow reversal at the torque limit (`r`)
/// the resistance ran away by more than 30 %, also with 10 s; with 7 s it reaches 19 %.
const RESISTANCE_S: f32 = 5.0;
const DECAY: f32 = CARRIER_S / RESISTANCE_S;
/// Largest relative deviation from the measured resistance, its growth per second, and its upper limit: the resistance of a winding at
/// one and a half times its rated current rises by less than 0.2 % per second. (With a wide range from the start on, resistance and
/// slow error ran away together while the q-axis current was constant, by 35 % and 12 Hz at 368 Hz rated. When the centre of the range
/// followed instead, a small error of the inverter's voltage moved it for minutes, until fault 41.)
const NEAR: f32 = 0.1;
const WARMING_PER_S: f32 = 0.002;
const FARTHEST: f32 = 0.5;
/// Standard deviation of the resistance behind a measurement, and without one: 0.27 of the voltage across it for model A at 0.7 A.
const MEASURED: f32 = 0.03;
pub(super) const UNMEASURED: f32 = 0.3;
/// Share of the resistance error, computed from the angle error of the injection beside the observer, that is corrected
/// in an injection period. (The leakage is not tracked in this way: with both, the error of one would hide in the
/// other.)
const FROM_INJECTION: f32 = 0.02;
/// Largest angle error that is used, rad: 3 degrees. The angle error of a resistance that is 20 % off is not larger, and an
/// injection with a larger error at this speed has little effect.
const LARGEST_ERROR: f32 = 0.05;
/// Middle of the currents, as a share of the learned torque limit.
const LEARNED_AT_SHARE: f32 = 0.5;
/// Number of voltages that are kept, which is enough for a current of age 6: two more than its age.
const VOLTAGES: usize = 8;

/// Coefficients of the observer, per control period.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Observer {
    /// T r_s, V s/A.
    r_s: f32,
    /// sigma L_s, H, its share at zero current, the change of that share per ampere, 1/A, and the saliency per ampere, 1/A.
    leakage: f32,
    leakage_share: f32,
    leakage_slope: f32,
    current_saliency: f32,
    /// Saliency fixed to the flux, at nominal flux.
    flux_saliency: f32,
    /// T alpha.
    rate: f32,
    /// L_M, H.
    coupled: f32,
    /// Nominal d-axis current, A, and its flux, V s.
    i_d: f32,
    nominal: f32,
    /// Least flux, V s.
    least: f32,
    /// Age of the current, samples; less than 6.
    pub age: f32,
}

/// State of the observer.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObserverState {
    /// Ring of the voltages of the last periods, V, backwards from `latest` on.
    voltages: [AlphaBeta; VOLTAGES],
    latest: usize,
    last: AlphaBeta,
    /// Length of the flux, V s.
    pub flux: f32,
    /// Current in the flux frame, A.
    current: Dq,
    /// Change of the flux in the last period due to the voltage, V s.
    pub change: Dq,
    /// Angle by which the flux turned in the last period, rad.
    pub turned: f32,
    /// Angle of the slip in that turn, rad.
    pub slip: f32,
    /// Gains g alpha and g w_r, from the last injection period.
    gain: Dq,
    /// `b/|i|`, 1/A^2, and `n + m |i|`.
    per_current: f32,
    leakage: f32,
    /// Saliency fixed to the flux, from the last injection period.
    flux_saliency: f32,
    /// Stator resistance.
    pub resistance: Resistance,
}

/// The tracked stator resistance with its bounds. A flying start does not measure the resistance and continues with the resistance
/// of the run before.
#[derive(Clone, Copy, Debug, Default)]
pub struct Resistance {
    /// Present resistance relative to the settings, less one.
    pub now: f32,
    /// Resistance that the last start at rest has measured, relative to the settings, less one.
    measured: f32,
    /// Largest deviation from the measured resistance.
    near: f32,
    /// Standard deviation with which the filter begins; 0 until it was measured.
    pub deviation: f32,
    /// Share of the deviation from the measured resistance that decays in an injection period; 0 until it was measured.
    pub decay: f32,
}

/// Saliency and leakage of the fundamental wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leakage {
    /// Saliency fixed to the flux, at nominal flux.
    pub flux_saliency: f32,
    /// Saliency per ampere of stator current, 1/A.
    pub current_saliency: f32,
    /// Leakage inductance of the fundamental wave at zero current, as a share of the leakage of the motor's parameters.
    pub share: f32,
    /// Change of that share per ampere, 1/A.
    pub slope: f32,
}

/// Weights of the errors in the speed that the observer sees. With an angle error e, a relative deviation r of the resistance, and a flux
/// that is longer than estimated by the share d, which decays by `delta`, that speed exceeds the true one by `per_angle` e +
/// `per_resistance` r + (`speed` + `pull` delta) d.
#[derive(Clone, Copy, Debug)]
pub struct SpeedWeights {
    /// `g w_r^2 - alpha`, rad/s per rad: the pull towards the flux of the observer's current model, less the rotor's own.
    pub per_angle: f32,
    /// `r_s (i_q - g w_r i_d)/psi`, rad/s.
    pub per_resistance: f32,
    /// `w_r`, rad/s, and `g w_r`.
    pub speed: f32,
    pub pull: f32,
}

/// Voltage that flux and leakage induce, for the feed-forward of the current loop.
#[derive(Clone, Copy, Debug, Default)]
pub struct Induced {
    /// Voltage of the q-axis current against the d axis, and of the d-axis current along the q axis, V/A.
    across: f32,
    along: f32,
    /// Voltage of the flux, V.
    flux: f32,
}

impl ObserverState {
    /// Resets the state to no flux and keeps the resistance, for this observer, if there is one.
    pub fn start(&mut self, observer: Option<&Observer>) {
        let flux = observer.map_or(0.0, |observer| observer.least);
        *self = Self { flux, resistance: self.resistance, ..Self::default() };
    }

    /// Takes the voltage of a step without the injection, V.
    pub fn put_out(&mut self, voltage: AlphaBeta) {
        self.latest = self.latest.wrapping_add(VOLTAGES - 1) % VOLTAGES;
        self.voltages[self.latest] = voltage;
    }

    /// Returns the voltage of so many periods before the latest, fewer than [`VOLTAGES`], V.
    fn before(&self, periods: usize) -> AlphaBeta {
        self.voltages[self.latest.wrapping_add(periods) % VOLTAGES]
    }

    /// Skips a period whose `current`, A, does not belong to the voltages.
    #[cold] // its stores are not merged with those of a step
    pub fn skip(&mut self, current: AlphaBeta) {
        self.last = current;
    }
}

impl Resistance {
    /// Takes a measured resistance, relative to the settings, less one.
    pub fn take(&mut self, measured: f32) {
        *self = Self { now: measured, measured, near: NEAR, deviation: MEASURED, decay: DECAY };
    }

    /// Takes into account that the winding may have warmed or cooled for so many seconds during which its resistance was not
    /// observed.
    pub fn rest(&mut self, seconds: f32) {
        let change = if self.decay > 0.0 { seconds * WARMING_PER_S } else { 0.0 };
        self.near = limited(self.near + change, FARTHEST);
        self.deviation = limited(self.deviation + change, UNMEASURED);
    }

    /// Adds a correction of the filter; the deviation from the measured resistance decays.
    pub fn correct(&mut self, correction: f32) {
        self.near = limited(self.near + CARRIER_S * WARMING_PER_S, FARTHEST);
        self.turn(correction - self.decay * (self.now - self.measured));
    }

    /// Adds a change within the bounds.
    fn turn(&mut self, change: f32) {
        let range = if self.decay > 0.0 {
            (self.measured - self.near, self.measured + self.near)
        } else {
            (RESISTANCE.0 - 1.0, RESISTANCE.1 - 1.0)
        };
        self.now = within(self.now + change, range);
    }
}

impl Observer {
    /// Creates the observer for a motor at the d-axis current `i_d`, A, with currents of this `age`, samples.
    pub fn new(motor: &Motor, leakage: &Leakage, i_d: f32, age: f32) -> Self {
        let coupled = motor.coupled_inductance();
        Self {
            r_s: PERIOD_S * motor.r_s,
            leakage: motor.sigma_l_s(),
            leakage_share: leakage.share,
            leakage_slope: leakage.slope,
            current_saliency: leakage.current_saliency,
            flux_saliency: leakage.flux_saliency,
            rate: PERIOD_S / motor.tau_r(),
            coupled,
            i_d,
            nominal: coupled * i_d,
            least: LEAST_FLUX * (coupled * i_d),
            age,
        }
    }

    /// Takes an accepted result of a self-commissioning.
    ///
    /// The demodulation sees `q = Im s/(1 - Re s)` of the saliency, where `Im s` is `2 a e` for a small angle error e
    /// and `2 b i_d i_q/|i|` for the q-axis current. Therefore a learned b is too small by the factor `1 - Re s`, about
    /// `1 - a + b |i|` in the middle of the currents.
    pub fn take(&mut self, learned: &Learned) {
        if let Some(slope) = &learned.slope {
            let k = slope.at_rest();
            self.flux_saliency = k / (2.0 + k);
        }
        if learned.current_saliency.accepted {
            let b = learned.current_saliency.value;
            let middle = b * LEARNED_AT_SHARE * learned.limit_a;
            self.current_saliency = b * (1.0 - self.flux_saliency + middle);
        }
    }

    /// Runs one period, with the `current` of a sample, A, and the voltages before it. `frame` is the axis of the flux at the
    /// time of the previous current; `leads`: whether the observer gives the angle.
    #[inline(always)] // runs in every period, with its values in registers
    pub fn step(
        &self,
        state: &mut ObserverState,
        current: AlphaBeta,
        frame: UnitVector,
        leads: bool,
    ) {
        let whole = self.age as usize;
        let (newer, older) = (state.before(whole + 1), state.before(whole + 2));
        let voltage = (newer + (older - newer) * (self.age - whole as f32)).to_dq(frame);
        let change = (current - state.last).to_dq(frame);
        let mean = ((current + state.last) * 0.5).to_dq(frame);
        state.last = current;

        let length = fpu_sqrt::sqrtf(mean.length_squared());
        let per_current = self.current_saliency / if length > self.i_d { length } else { self.i_d };
        let share = self.leakage_share + self.leakage_slope * length;
        (state.per_current, state.leakage) = (per_current, share);
        let s = Dq {
            d: state.flux_saliency + per_current * (mean.d * mean.d - mean.q * mean.q),
            q: 2.0 * per_current * mean.d * mean.q,
        };
        let leakage = Dq {
            d: (share - s.d) * change.d - s.q * change.q,
            q: (share + s.d) * change.q - s.q * change.d,
        };
        let r_s = self.r_s * (1.0 + state.resistance.now);
        let e = voltage * PERIOD_S - mean * r_s - leakage * self.leakage;
        state.change = e;
        let grown = self.rate * (self.coupled * mean.d - state.flux);
        let deviation = grown - e.d;
        let flux = state.flux + e.d + state.gain.d * deviation;
        let flux = if flux < self.least { self.least } else { flux };
        let per_flux = 1.0 / flux;
        let x = limited((e.q + state.gain.q * deviation) * per_flux, LARGEST_TANGENT);
        state.turned = x - x * x * x * (1.0 / 3.0);
        state.slip = self.rate * self.coupled * mean.q * per_flux;
        state.flux = if leads { flux * (1.0 + 0.5 * x * x) } else { state.flux + grown };
        state.current = mean;
    }

    /// Computes the gains for a rotor speed `rotor_freq`, electrical turns per period, and the saliency at the present flux;
    /// called once an injection period.
    pub fn update(&self, state: &mut ObserverState, rotor_freq: f32) {
        let (a, w) = (self.rate, rotor_freq * TAU);
        let gain = 2.0 * (GAIN_AT_STANDSTILL * a + GAIN_PER_SPEED * w.abs()) / (a * a + w * w);
        state.gain = Dq { d: gain * a, q: gain * w };
        state.flux_saliency = self.flux_saliency * (state.flux / self.nominal);
    }

    /// Tracks the resistance while the observer leads, by the angle `error` of the injection, rad, flux less estimate, at a flux of
    /// `flux_freq`, electrical turns per period; called once an injection period.
    pub fn compare_with_injection(&self, state: &mut ObserverState, error: f32, flux_freq: f32) {
        let angle = self.r_s * self.i_d / (state.flux * flux_freq * TAU);
        state.resistance.turn(FROM_INJECTION * angle * limited(error, LARGEST_ERROR));
    }

    /// Whether there is enough flux to show an angle and a speed.
    pub fn has_flux(&self, state: &ObserverState) -> bool {
        state.flux > LEAST_FLUX_SHARE * self.nominal
    }

    /// Returns the observed speed of the rotor and its age, samples, for a mean `turn` of the flux in an injection period, both in
    /// electrical turns per period.
    pub fn seen_speed(&self, state: &ObserverState, turn: f32) -> (f32, f32) {
        (turn - state.slip * (1.0 / TAU), self.age + SEEN_AGE)
    }

    /// Returns what else is in that speed, at a speed `rotor_freq` of the rotor, electrical turns per period.
    pub fn weights(&self, state: &ObserverState, rotor_freq: f32) -> SpeedWeights {
        let speed = rotor_freq * (TAU / PERIOD_S);
        let current = state.current.q - state.gain.q * state.current.d;
        SpeedWeights {
            per_angle: state.gain.q * speed - self.rate * (1.0 / PERIOD_S),
            per_resistance: self.r_s * (1.0 / PERIOD_S) * current / state.flux,
            speed,
            pull: state.gain.q,
        }
    }

    /// Returns the current that makes the flux, A, with the magnetising inductance of the settings.
    pub fn magnetising(&self, state: &ObserverState) -> f32 {
        state.flux / self.coupled
    }

    /// Returns the voltage that flux and leakage induce at `flux_freq`, electrical turns per period.
    pub fn induced(&self, state: &ObserverState, flux_freq: f32) -> Induced {
        let w = flux_freq * TAU / PERIOD_S;
        let leakage =
            self.leakage * (state.leakage + state.per_current * state.current.length_squared());
        Induced { across: w * leakage, along: w * self.leakage, flux: w * state.flux }
    }
}

impl Induced {
    /// Returns the voltage at this current, V.
    pub fn at(&self, current: Dq) -> Dq {
        Dq { d: -self.across * current.q, q: self.along * current.d + self.flux }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Settings, find};

    #[test]
    fn the_voltages_of_the_largest_delay_are_kept() {
        let mut settings = Settings::default();
        let (_, largest) = find("scales.current_delay_s").unwrap().range(&settings).unwrap();
        settings.scales.current_delay_s = largest;
        let observer = settings.build().unwrap().observer.unwrap();
        assert!(observer.age < (VOLTAGES - 2) as f32, "{}", observer.age);
    }

    /// A deviation from the measured resistance decays. A deviation from the resistance of the run before does not.
    #[test]
    fn the_resistance_returns_to_the_measured_one() {
        let after = |measured: Option<f32>, seconds: f32| {
            let mut resistance = Resistance { now: 0.2, ..Resistance::default() };
            if let Some(measured) = measured {
                resistance.take(measured);
            }
            resistance.correct(0.05);
            for _ in 0..(600.0 * seconds) as usize {
                resistance.correct(0.0);
            }
            resistance.now
        };
        assert!((after(None, 60.0) - 0.25).abs() < 1e-3);
        assert!((after(Some(-0.1), 0.0) + 0.05).abs() < 1e-3);
        let left = -0.1 + 0.05 * libm::expf(-1.0);
        assert!((after(Some(-0.1), RESISTANCE_S) - left).abs() < 1e-3);
    }

    /// The tracked resistance stays within the range of the measured resistance and its possible change by heating since then.
    #[test]
    fn the_resistance_stays_near_the_measured_one() {
        let mut resistance = Resistance::default();
        resistance.take(0.2);
        let mut pull = |seconds: f32, by: f32| {
            (0..(600.0 * seconds) as usize).for_each(|_| resistance.correct(by));
            resistance.now
        };
        assert!((pull(1.0, 0.05) - (0.2 + NEAR + WARMING_PER_S)).abs() < 1e-3);
        assert!((pull(2.0, -0.05) - (0.2 - NEAR - 3.0 * WARMING_PER_S)).abs() < 1e-3);
        assert!((pull(97.0, 0.05) - (0.2 + NEAR + 100.0 * WARMING_PER_S)).abs() < 2e-3);
        assert!((pull(300.0, 0.05) - (0.2 + FARTHEST)).abs() < 2e-3);
    }

    /// A current that was near zero at the last update grows to 3.5 A before the next. Its saliency is wrong by no more than the
    /// saliency of the nominal current, and the observed flux is constant. (With `b/|i|` of the last update, half of the voltage of the
    /// leakage would be observed as flux at only 1 A.)
    #[test]
    fn a_current_that_passes_zero_does_not_turn_the_flux() {
        let motor = Motor::default();
        let per_a = 0.03;
        let leakage =
            Leakage { flux_saliency: 0.0, current_saliency: per_a, share: 1.0, slope: 0.0 };
        let observer = Observer::new(&motor, &leakage, 1.4, 0.0);
        let mut state = ObserverState::default();
        state.start(Some(&observer));
        state.current = Dq { d: 0.05, q: 0.0 };
        observer.update(&mut state, 0.0);
        let change = 0.35;
        for n in 0..10 {
            let (before, after) = (change * n as f32, change * (n + 1) as f32);
            let mean = 0.5 * (before + after);
            // The voltage of a constant flux consists of the resistance and of the leakage with its true saliency along the
            // current.
            let sigma = motor.sigma_l_s();
            let leakage = sigma * (1.0 - per_a * mean) * change;
            let alpha = motor.r_s * mean + leakage / PERIOD_S;
            state.put_out(AlphaBeta { alpha, beta: 0.0 });
            state.put_out(AlphaBeta::ZERO);
            let current = AlphaBeta { alpha: after, beta: 0.0 };
            observer.step(&mut state, current, UnitVector::default(), true);
            let seen = fpu_sqrt::sqrtf(state.change.length_squared()) / (sigma * change);
            assert!(seen < 0.2, "{after} A: {seen}");
        }
    }

    /// Runs the observer in a frame that is `e` behind a flux which is longer by the share `d`, with a resistance that is `r` higher than
    /// estimated. Returns the observed speed of the rotor above the true one, rad/s. The current is regulated, so it is the same in the
    /// frame with any error; the flux changes by the rotor equation.
    fn seen_beyond(stator: f32, (e, r, d): (f32, f32, f32), current: Dq) -> (f32, SpeedWeights) {
        let motor = Motor::default();
        let leakage = Leakage { flux_saliency: 0.0, current_saliency: 0.0, share: 1.0, slope: 0.0 };
        let observer = Observer::new(&motor, &leakage, 1.4, 0.0);
        let (mut state, alpha) = (ObserverState::default(), 1.0 / motor.tau_r());
        let psi = motor.coupled_inductance() * current.d;
        state.start(Some(&observer));
        state.flux = psi;
        let rotor = stator - alpha * current.q / current.d;
        let angle = |n: i32| {
            let turns = f64::from(stator) * f64::from(n) * f64::from(PERIOD_S) / f64::from(TAU);
            crate::Angle::from_turns((turns % 1.0) as f32)
        };
        let frame = |n: i32| angle(n).unit_vector();
        state.last = current.to_alpha_beta(frame(0));
        observer.update(&mut state, rotor * PERIOD_S / TAU);
        let grown = psi * (1.0 + d);
        let mut flux = Dq { d: grown * libm::cosf(e), q: grown * libm::sinf(e) };
        for n in 0..2 {
            let [before, after] = [n, n + 1].map(|n| current.to_alpha_beta(frame(n)));
            let (driven, slip) = (motor.coupled_inductance() * alpha, stator - rotor);
            let next = Dq {
                d: flux.d + PERIOD_S * (driven * current.d - alpha * flux.d + slip * flux.q),
                q: flux.q + PERIOD_S * (driven * current.q - alpha * flux.q - slip * flux.d),
            };
            let turned = next.to_alpha_beta(frame(n + 1)) - flux.to_alpha_beta(frame(n));
            let drop = (before + after) * (0.5 * PERIOD_S * motor.r_s * (1.0 + r));
            state
                .put_out((drop + (after - before) * motor.sigma_l_s() + turned) * (1.0 / PERIOD_S));
            state.put_out(AlphaBeta::ZERO);
            // The length in the observer is that of the current model.
            state.flux = psi;
            observer.step(&mut state, after, frame(n), false);
            flux = next;
        }
        let seen = (state.turned - state.slip) / PERIOD_S - rotor;
        (seen, observer.weights(&state, rotor * PERIOD_S / TAU))
    }

    /// Compares size and sign of the effects of an angle error, of the resistance and of a longer flux, as the filter assumes them, with
    /// finite differences of a machine.
    #[test]
    fn the_seen_speed_has_the_weights_that_the_filter_takes() {
        for stator in [-80.0, -20.0, 10.0, 60.0] {
            for i_q in [-2.0, 0.5, 2.5] {
                let at = |error| seen_beyond(stator, error, Dq { d: 1.4, q: i_q });
                let (_, model) = at((0.0, 0.0, 0.0));
                let slope = |ahead, behind, by: f32| (at(ahead).0 - at(behind).0) / (2.0 * by);
                let by_angle = slope((0.02, 0.0, 0.0), (-0.02, 0.0, 0.0), 0.02);
                let by_resistance = slope((0.0, 0.05, 0.0), (0.0, -0.05, 0.0), 0.05);
                let by_growth = slope((0.0, 0.0, 0.02), (0.0, 0.0, -0.02), 0.02);
                let close =
                    |found: f32, model: f32| (found - model).abs() < 0.03 * model.abs() + 0.5;
                assert!(close(by_angle, model.per_angle), "{by_angle} {model:?}");
                assert!(close(by_resistance, model.per_resistance), "{by_resistance} {model:?}");
                let alpha = 1.0 / Motor::default().tau_r();
                let growth = model.speed + model.pull * alpha;
                assert!(close(by_growth, growth), "{by_growth} {model:?}");
            }
        }
    }
}
