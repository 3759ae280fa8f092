//! Currents that the voltage of the dc link allows: field weakening, and the limit of the q-axis current, computed once an injection
//! period. If it is enabled, loss minimisation chooses the d-axis current.
//!
//! `w = |w_s|` is the angular frequency of the stator. The usable voltage `U` is 0.92 of the largest vector less the injected
//! amplitude, times a trim:
//!
//! ```text
//! q-axis: leakage      i_u = 0.6 min(U, U without trim)/(w sigma L_s)
//! d-axis current       i_d <= (sqrt(U^2 - (w sigma L_s min(|i_q|, i_u))^2) - r_s s |i_q|)/(w L_s)     s = sign(i_q w_s)
//! q-axis current       |i_q| <= min(sqrt(I^2 - i_d^2), i_u)
//! trim                 d trim/dt = -5 (|u| - U)/U per second, within 0.6 .. 1.3
//! ```
//!
//! Above 1 the trim rises only if the flux is weakened, and a fifth as fast, because a flux that still builds up must not be
//! mistaken for one that is too small. The largest torque needs a share of 0.71 for the leakage. The share 0.6 costs at most 4 %
//! of that torque. With parameters that are 5 % off, it keeps the drive from the range in which more q-axis current gives less
//! torque until there is no flux left to track.
//!
//! The d-axis current stays between 15 % and 100 % of its setting and has priority, since a q-axis current without flux
//! gives no torque. The feed-forward does most of the work; the trim corrects for errors of the parameters within 0.2 s.
//! (If the main flux saturates, the motor needs less d-axis current for a weakened flux than its parameters say.)
//!
//! With a rotor current of `(L_m/L_r) i_q`, the loss in stator and rotor is `1.5 (r_s i_d^2 + (r_s + R_R) i_q^2)` for a torque in
//! proportion to `i_d i_q`. It is smallest with `i_d = e |i_q|`, `e = sqrt((r_s + R_R)/r_s)`. The d-axis current follows this value
//! upwards at once and downwards within 0.3 s, between half the setting and the setting. A torque for which the present flux is too
//! small builds up with the rotor time constant.

use core::f32::consts::TAU;

use crate::carrier::CARRIER_SAMPLES;
use crate::math::within;
use crate::{Dq, Motor, PERIOD_S};

/// Share of the voltage that is used. The rest is for the current controllers.
const USABLE_SHARE: f32 = 0.92;
/// Share of the voltage that the leakage may take.
const FOR_LEAKAGE: f32 = 0.6;
/// Least d-axis current, as a share of the setting.
const LEAST_I_D_SHARE: f32 = 0.15;
/// Least d-axis current of the loss minimisation, as a share of the setting. With less flux, the injection would show no angle when
/// it is switched on.
const LEAST_ECONOMICAL: f32 = 0.5;
/// Share by which the difference to a smaller d-axis current shrinks in an injection period: 0.3 s.
const EASED: f32 = CARRIER_SAMPLES as f32 * PERIOD_S / 0.3;
/// Change of the trim in an injection period per relative excess of the voltage.
const TRIM: f32 = 5.0 * CARRIER_SAMPLES as f32 * PERIOD_S;
/// The same change above a trim of 1, slower than a flux that builds up.
const TRIM_UP: f32 = 0.2 * TRIM;
/// Smallest and largest trim.
const LEAST_TRIM: f32 = 0.6;
const MOST_TRIM: f32 = 1.3;

/// Coefficients of the limit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct VoltageLimit {
    pub(crate) r_s: f32,
    leakage: f32,
    stator: f32,
    /// Setting of the d-axis current, A.
    pub i_d: f32,
    /// Square of the largest current, A^2.
    current_squared: f32,
    /// D-axis current of the least loss per q-axis current; 0 without loss minimisation.
    economy: f32,
}

/// State of the limit, with its results.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VoltageLimitState {
    trim: f32,
    /// Voltage that is available in field weakening, V peak; 0 if the flux is kept.
    pub available: f32,
    /// Largest d-axis and q-axis current, A.
    pub most: Dq,
    /// Whether the voltage limits the q-axis current.
    pub by_voltage: bool,
}

/// Operating point of an injection period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatingPoint {
    /// Current reference, A.
    pub current: Dq,
    /// Voltage without the injection, V.
    pub voltage: Dq,
    /// Largest voltage vector that the injection leaves, V.
    pub largest: f32,
    /// Frequency of the flux, electrical turns per period.
    pub flux_freq: f32,
    /// Whether the flux is kept. With injection it is, because the learned saliency is valid for one d-axis current.
    pub kept: bool,
    /// D-axis current in addition to the setting, A.
    pub added: f32,
}

/// Returns the angular frequency, rad/s, from electrical turns per period; it is never zero.
fn angular(flux_freq: f32) -> f32 {
    flux_freq.abs() * (TAU / PERIOD_S) + 1.0
}

impl VoltageLimit {
    /// Creates the limit for a motor with the d-axis current `i_d`, A, and currents up to `largest_a`, A peak.
    pub fn new(motor: &Motor, i_d: f32, largest_a: f32) -> Self {
        let leakage = motor.sigma_l_s();
        Self {
            r_s: motor.r_s,
            leakage,
            stator: leakage + motor.coupled_inductance(),
            i_d,
            current_squared: largest_a * largest_a,
            economy: 0.0,
        }
    }

    /// Returns the limit with loss minimisation for `motor`.
    #[must_use]
    pub fn economical(self, motor: &Motor) -> Self {
        let per_stator = 1.0 + motor.coupled_inductance() / (motor.tau_r() * motor.r_s);
        Self { economy: fpu_sqrt::sqrtf(per_stator), ..self }
    }

    /// Whether the d-axis current minimises the loss while there is no injection.
    #[inline]
    pub fn minimises_loss(&self) -> bool {
        self.economy != 0.0
    }

    /// Returns the d-axis current of the least loss for the q-axis current `i_q`, after the value `last`, A; with injection
    /// (`carrier`), the setting.
    pub fn least_loss(&self, last: f32, i_q: f32, carrier: bool) -> f32 {
        let least = within(self.economy * i_q.abs(), (LEAST_ECONOMICAL * self.i_d, self.i_d));
        if carrier {
            self.i_d
        } else if least < last {
            last + EASED * (least - last)
        } else {
            least
        }
    }

    /// Returns the state without a limit.
    pub fn start(&self) -> VoltageLimitState {
        let most = Dq { d: self.i_d, q: self.beside(self.i_d) };
        VoltageLimitState { trim: 1.0, available: 0.0, most, by_voltage: false }
    }

    /// Returns the q-axis current that a d-axis current leaves, A.
    #[inline]
    pub fn beside(&self, i_d: f32) -> f32 {
        fpu_sqrt::sqrtf(self.current_squared - i_d * i_d)
    }

    /// Returns the back-EMF of the magnetising current per speed of the rotor, V per A and electrical turn per period.
    pub fn emf(&self) -> f32 {
        (self.stator - self.leakage) * (TAU / PERIOD_S)
    }

    /// Updates the limits.
    pub fn step(&self, state: &mut VoltageLimitState, now: &OperatingPoint) {
        let &OperatingPoint { current, voltage, largest, flux_freq, kept, added } = now;
        let whole = USABLE_SHARE * largest;
        let available = whole * state.trim;
        // This is (|u| - U)/U near U, without the root.
        let excess = 0.5 * (voltage.length_squared() / (whole * whole) - 1.0);
        let rate = if excess < 0.0 && state.trim >= 1.0 { TRIM_UP } else { TRIM };
        let trim = state.trim - rate * excess;
        let most_trim = if state.most.d < self.i_d { MOST_TRIM } else { 1.0 };
        let trim = if trim < most_trim { trim } else { most_trim };
        state.trim = if trim < LEAST_TRIM { LEAST_TRIM } else { trim };

        let untrimmed = if available < whole { available } else { whole };
        let by_leakage = self.by_leakage(untrimmed, flux_freq);
        let i_d = if kept { self.i_d } else { self.direct(available, flux_freq, current.q) };
        state.available = if kept { 0.0 } else { available };
        let all = i_d + added;
        let rest = self.beside(all);
        state.by_voltage = by_leakage < rest;
        state.most = Dq { d: i_d, q: if state.by_voltage { by_leakage } else { rest } };
    }

    /// Returns the largest d-axis current, A, with the q-axis current `i_q`, A, if `available` V can be used.
    #[inline]
    pub fn direct(&self, available: f32, flux_freq: f32, i_q: f32) -> f32 {
        let by_leakage = self.by_leakage(available, flux_freq);
        let (w, size) = (angular(flux_freq), i_q.abs());
        let drop = self.r_s * if i_q * flux_freq < 0.0 { -size } else { size };
        let across = w * self.leakage * if size < by_leakage { size } else { by_leakage };
        let along = fpu_sqrt::sqrtf(available * available - across * across) - drop;
        let i_d = along / (w * self.stator);
        // NaN gives the setting; the control step detects the NaN.
        if i_d.is_nan() { self.i_d } else { within(i_d, (LEAST_I_D_SHARE * self.i_d, self.i_d)) }
    }

    /// Returns the q-axis current, A, whose leakage takes its share of the voltage.
    #[inline]
    fn by_leakage(&self, available: f32, flux_freq: f32) -> f32 {
        FOR_LEAKAGE * available / (angular(flux_freq) * self.leakage)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs for 3 s at 120 Hz without torque, with a motor whose stator inductance is `share` of the setting and whose flux follows
    /// within 0.19 s. Returns the state, the voltage relative to the usable voltage, and its maximum.
    fn weakened(share: f32) -> (VoltageLimitState, f32, f32) {
        let limit = VoltageLimit::new(&Motor::default(), 1.4, 3.5);
        let mut state = limit.start();
        let (largest, freq) = (170.0, 120.0);
        let per_a = freq * TAU * limit.stator * share;
        let (mut flux_current, mut most) = (0.0, 0.0_f32);
        for _ in 0..1800 {
            let i_d = state.most.d;
            flux_current += (i_d - flux_current) * CARRIER_SAMPLES as f32 * PERIOD_S / 0.19;
            let voltage = Dq { d: 0.0, q: per_a * flux_current };
            most = most.max(voltage.q / (USABLE_SHARE * largest));
            let current = Dq { d: i_d, q: 0.0 };
            let flux_freq = freq * PERIOD_S;
            let now =
                OperatingPoint { current, voltage, largest, flux_freq, kept: false, added: 0.0 };
            limit.step(&mut state, &now);
        }
        (state, per_a * flux_current / (USABLE_SHARE * largest), most)
    }

    /// The trim brings the voltage to the usable voltage, whether the motor needs more or less than its parameters say. A flux
    /// that builds up does not cause a large overshoot of the trim, and the q-axis current never gets more than its share of
    /// the untrimmed voltage.
    #[test]
    fn the_voltage_is_used_with_parameters_that_are_off() {
        for share in [0.8, 1.0, 1.2] {
            let (state, voltage, most) = weakened(share);
            assert!((voltage - 1.0).abs() < 0.02, "{share}: {voltage}");
            assert!(most < 1.06 * share.max(1.0), "{share}: {most}");
            let limit = VoltageLimit::new(&Motor::default(), 1.4, 3.5);
            let untrimmed = limit.by_leakage(USABLE_SHARE * 170.0, 120.0 * PERIOD_S);
            assert!(state.most.q <= untrimmed * 1.0001, "{share}: {} {untrimmed}", state.most.q);
        }
    }

    /// If the flux is not weakened, the unused voltage does not wind the trim up.
    #[test]
    fn the_trim_does_not_wind_up_below_the_limit() {
        let limit = VoltageLimit::new(&Motor::default(), 1.4, 3.5);
        let mut state = limit.start();
        let voltage = Dq { d: 0.0, q: 40.0 };
        let current = Dq { d: 1.4, q: 0.0 };
        let flux_freq = 20.0 * PERIOD_S;
        let now =
            OperatingPoint { current, voltage, largest: 170.0, flux_freq, kept: false, added: 0.0 };
        (0..6000).for_each(|_| limit.step(&mut state, &now));
        assert_eq!((state.trim, state.most.d), (1.0, 1.4));
    }

    /// The d-axis current gives the torque with the least loss. It rises at once, falls within 0.3 s, and is the setting with
    /// injection.
    #[test]
    fn the_loss_is_least_where_that_is_asked_for() {
        let motor = Motor::default();
        let limit = VoltageLimit::new(&motor, 2.0, 4.2).economical(&motor);
        let r_r = motor.coupled_inductance() / motor.tau_r();
        let loss = |i_d: f32, i_q: f32| motor.r_s * (i_d * i_d + i_q * i_q) + r_r * i_q * i_q;
        for i_q in [-1.1, 1.1, 1.5] {
            let i_d = (0..1800).fold(2.0, |last, _| limit.least_loss(last, i_q, false));
            let same_torque = |share: f32| loss(share * i_d, i_q / share);
            assert!(same_torque(0.97) > loss(i_d, i_q) && same_torque(1.03) > loss(i_d, i_q));
        }
        assert_eq!(limit.least_loss(1.0, -2.5, false), 2.0);
        let eased = (0..180).fold(2.0, |last, _| limit.least_loss(last, 0.1, false));
        assert!((eased - 1.368).abs() < 0.01, "{eased}");
        assert_eq!(limit.least_loss(1.0, 0.1, true), 2.0);
    }
}
