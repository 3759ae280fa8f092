//! Currents that the voltage of the dc link allows: field weakening, and the limit of the torque current; once a carrier period.
//!
//! `w = |w_s|` is the angular frequency of the stator. The usable voltage `U` is 0.92 of the largest vector less the amplitude of
//! the carrier, times a trim:
//!
//! ```text
//! i_q of the leakage   i_u = 0.7 U/(w sigma L_s)
//! direct current       i_d <= (sqrt(U^2 - (w sigma L_s min(|i_q|, i_u))^2) - r_s s |i_q|)/(w L_s)     s = sign(i_q w_s)
//! torque current       |i_q| <= min(sqrt(I^2 - i_d^2), i_u)
//! trim                 d trim/dt = -5 (|u| - U)/U per second, within 0.6 .. 1
//! ```
//!
//! The direct current stays within 15 % of its setting and the setting, and comes first: a torque current without flux gives
//! no torque. The feed-forward does the work; the trim takes 0.2 s for what the parameters miss. (A main flux that saturates
//! needs less direct current for the same flux.)

use core::f32::consts::TAU;

use crate::carrier::injection::CARRIER_SAMPLES;
use crate::io::PERIOD_S;
use crate::math::frames::Dq;
use crate::settings::Motor;

/// Share of the voltage that is used: the rest is for the current controllers.
const USED: f32 = 0.92;
/// Share of the voltage that the leakage may take.
const FOR_LEAKAGE: f32 = 0.6;
/// Least direct current, as a share of the setting.
const LEAST: f32 = 0.15;
/// Change of the trim in a carrier period per relative excess of the voltage.
const TRIM: f32 = 5.0 * CARRIER_SAMPLES as f32 * PERIOD_S;
/// The same from 1 on upwards: slower than a flux that builds up.
const TRIM_UP: f32 = 0.2 * TRIM;
/// Least trim.
const LEAST_TRIM: f32 = 0.6;
const MOST_TRIM: f32 = 1.3;

/// Coefficients of the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageLimit {
    r_s: f32,
    leakage: f32,
    stator: f32,
    /// Setting of the direct current, and the torque current that it leaves, A.
    i_d: f32,
    i_q: f32,
    /// Square of the largest current, A^2.
    current_squared: f32,
}

/// State of the limit, with its results.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VoltageLimitState {
    trim: f32,
    /// Voltage that weakens the flux, V peak; 0 where the flux is kept.
    pub available: f32,
    /// Most direct and torque current, A.
    pub most: Dq,
    /// Whether the latter is that of the voltage.
    pub by_voltage: bool,
}

/// Operating point of a carrier period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Operation {
    /// Reference of the current, A.
    pub current: Dq,
    /// Voltage without the carrier, V.
    pub voltage: Dq,
    /// Largest voltage vector that the carrier leaves, V.
    pub largest: f32,
    /// Frequency of the flux, electrical turns per period.
    pub flux_freq: f32,
    /// Whether the flux is kept, as with a carrier: what the injection has learned is that of one direct current.
    pub kept: bool,
    /// Direct current on top of the setting, A.
    pub added: f32,
}

/// Angular frequency that is not zero, rad/s, from electrical turns per period.
fn angular(flux_freq: f32) -> f32 {
    flux_freq.abs() * (TAU / PERIOD_S) + 1.0
}

impl VoltageLimit {
    /// Limit for a motor at the direct current `i_d`, A, with currents up to `largest_a`, A peak.
    pub fn new(motor: &Motor, i_d: f32, largest_a: f32) -> Self {
        let leakage = motor.sigma_l_s();
        Self {
            r_s: motor.r_s,
            leakage,
            stator: leakage + motor.coupled_inductance(),
            i_d,
            i_q: libm::sqrtf(largest_a * largest_a - i_d * i_d),
            current_squared: largest_a * largest_a,
        }
    }

    /// State without a limit.
    pub fn start(&self) -> VoltageLimitState {
        let most = Dq { d: self.i_d, q: self.i_q };
        VoltageLimitState { trim: 1.0, available: 0.0, most, by_voltage: false }
    }

    /// Updates the limits.
    pub fn step(&self, state: &mut VoltageLimitState, now: &Operation) {
        let &Operation { current, voltage, largest, flux_freq, kept, added } = now;
        let whole = USED * largest;
        let available = whole * state.trim;
        // (|u| - U)/U near U, without the root.
        let excess = 0.5 * (voltage.length_squared() / (whole * whole) - 1.0);
        let rate = if excess < 0.0 && state.trim >= 1.0 { TRIM_UP } else { TRIM };
        let trim = state.trim - rate * excess;
        let most_trim = if state.most.d < self.i_d { MOST_TRIM } else { 1.0 };
        state.trim = if trim < LEAST_TRIM {
            LEAST_TRIM
        } else if trim < most_trim {
            trim
        } else {
            most_trim
        };

        let by_leakage = self.by_leakage(if available < whole { available } else { whole }, flux_freq);
        let i_d = if kept { self.i_d } else { self.direct(available, flux_freq, current.q) };
        state.available = if kept { 0.0 } else { available };
        let all = i_d + added;
        let rest =
            if all == self.i_d { self.i_q } else { libm::sqrtf(self.current_squared - all * all) };
        state.by_voltage = by_leakage < rest;
        state.most = Dq { d: i_d, q: if state.by_voltage { by_leakage } else { rest } };
    }

    /// Most direct current, A, with the torque current `i_q`, A, where `available` V can be used.
    #[inline]
    pub fn direct(&self, available: f32, flux_freq: f32, i_q: f32) -> f32 {
        let by_leakage = self.by_leakage(available, flux_freq);
        let (w, size) = (angular(flux_freq), i_q.abs());
        let drop = self.r_s * if i_q * flux_freq < 0.0 { -size } else { size };
        let across = w * self.leakage * if size < by_leakage { size } else { by_leakage };
        let along = libm::sqrtf(available * available - across * across) - drop;
        let i_d = along / (w * self.stator);
        // NaN gives the setting; the step finds it.
        if i_d.is_nan() || i_d >= self.i_d {
            self.i_d
        } else if i_d < LEAST * self.i_d {
            LEAST * self.i_d
        } else {
            i_d
        }
    }

    /// Torque current, A, whose leakage takes its share of the voltage.
    #[inline]
    fn by_leakage(&self, available: f32, flux_freq: f32) -> f32 {
        FOR_LEAKAGE * available / (angular(flux_freq) * self.leakage)
    }
}
