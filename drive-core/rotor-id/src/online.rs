//! Online estimation of the rotor time constant, and of the speed, from voltage and current.
//!
//! ```text
//! control step, 6 kHz: measured current, realised voltage -> ring
//! idle loop:           ring -> Online::push (filters, recursive least squares) -> Online::refine, 10 Hz
//!                      -> Command::RotorTimeConstant
//! ```
//!
//! [`Rls`] condenses the last 1.7 s into four complex coefficients and their covariance. They are not
//! inverted one by one (Model D): in operation at most three sinusoids excite four complex unknowns, and
//! the inverse gives a speed wrong by a factor of two on noise-free simulated data.
//! [`refine`](Online::refine) instead fits a *machine model* to them, weighted by the covariance, so that
//! directions without excitation carry no weight. The inductances of the model are those of the settings;
//! its unknowns are:
//!
//! * the stator resistance, which absorbs the uncompensated dead time: the sign of a sinusoidal current
//!   has a fundamental in phase with it, and acts like a resistance;
//! * 1 / tau_r;
//! * the speed, without an encoder. The flux magnitude must then vary: in the steady state speed and rotor
//!   resistance appear as the slip alone, and the result is [`NoEstimate::PoorExcitation`] until the
//!   magnetising current is modulated, for example by ±0.2 A at 2 Hz
//!   ([`Command::Magnetising`](drive_core::Command::Magnetising)). The speed of the tracking loop of the
//!   injection is no substitute, since it contains the assumed slip.
//!
//! Changes of speed or torque do not fit a constant machine, so they restart the estimation. Three
//! seconds of steady operation give the next estimate. Measured on the simulated motor with the encoder,
//! over torque steps between -2 A and 3 A, 0 to 150 rpm, up to half of the dead time uncompensated and
//! 0.8 to 1.3 times the rotor resistance of the settings: every published estimate is within 6 %.
//!
//! The cost is an estimated 200 cycles of a Cortex-M4 per control period and 1000 more in every eighth,
//! 2 MHz in all, and the fit ten times a second.
//!
//! The saliency increases the apparent transient inductance along the current. The two saliencies of the
//! sensorless settings account for it (without them tau_r is 11 % low at 2 A).

mod fit;

use core::f32::consts::TAU;

use crate::rls::filter::Filter;
use crate::rls::{Rls, RlsError, RlsSettings};
use drive_core::flux::TAU_R_LIMITS;
use drive_core::{AlphaBeta, Dq, PERIOD_S, within};
use drive_settings::Settings;
use fit::{Machine, Unknowns};
use num_complex::Complex32;

/// Control periods per sample of the least squares: 750 Hz. At 6 kHz the increments, which carry the
/// information on the rotor, would be a thousandth of the signals.
const DECIMATION: u8 = 8;
/// Sampling period of the least squares, s.
pub const SAMPLE_S: f32 = DECIMATION as f32 * PERIOD_S;
/// Corner of the filters before the decimation, Hz: they attenuate the injection by 27 000.
const BEFORE_HZ: f32 = 20.0;
/// Corner of the filters of the least squares, Hz. They reject the harmonics of the dead time and pass
/// enough of the fundamental up to about 20 Hz.
const CORNER_HZ: f32 = 10.0;
/// Memory of 1250 samples, 1.7 s.
const LAMBDA: f32 = 0.9992;
/// Initial covariance in units of the bases.
const P0: f32 = 1e6;
/// Weight of a call of `refine` in the means of current and speed: one memory at ten calls per second.
const SMOOTHING: f32 = 0.06;
/// Calls of `refine` until the memory is full.
const SETTLE: u32 = 30;
/// Largest deviation of a known speed from its mean, electrical rad/s; beyond, the machine is not constant.
const STEADY: f32 = 3.0;
/// Largest deviation of a guessed speed, electrical rad/s: the tracking loop follows the modulated flux.
const STEADY_GUESS: f32 = 12.0;
/// Largest deviation of the current reference from its mean, as a share of the magnetising current. The
/// saliency depends on the current, and the residual dead time does not scale with it: a step of 2 A gave
/// an error of 24 % in tau_r.
const STEADY_CURRENT: f32 = 0.25;
/// Largest number of consecutive missing samples.
const MISSING: u32 = 75;
/// Largest relative change of the rate and of the resistance in the last step of the fit for a published tau_r.
const AT_REST: f32 = 0.04;
/// Largest published relative uncertainty of tau_r. It covers the noise alone; where it is larger, the
/// systematic error is larger still. At standstill with a slip below 0.3 Hz the error of tau_r was 80 % at
/// an uncertainty of 4 %, and at most 6 % at an uncertainty of 1 %.
const UNCERTAIN: f32 = 0.01;
/// Largest published uncertainty with an estimated speed and a modulated magnetising current.
const UNCERTAIN_GUESS: f32 = 0.04;

/// Prior information on the speed of the rotor, electrical rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpeedInput {
    /// Measured by an encoder: not estimated.
    Known(f32),
    /// From the tracking loop of the injection: initial value of the fit.
    Guess(f32),
}

/// Estimate of the rotor parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RotorEstimate {
    /// Rotor time constant, s.
    pub tau_r: f32,
    /// Stator resistance including the equivalent resistance of the uncompensated dead time, ohm.
    pub resistance: f32,
    /// Speed of the rotor, electrical rad/s: the known one, or the estimate.
    pub omega_m: f32,
    /// Relative uncertainty of tau_r by the noise.
    pub uncertainty: f32,
}

/// Reason why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoEstimate {
    /// The memory is not full yet since the start, or since samples were missing.
    #[error("settling")]
    Settling,
    /// Speed or current changed; the estimation restarts.
    #[error("speed or torque change")]
    Transient,
    /// The signals do not determine tau_r (and the speed).
    #[error("the excitation is too poor")]
    PoorExcitation,
    /// tau_r outside [`TAU_R_LIMITS`] times the setting, or a stator resistance below zero or above three
    /// times the setting.
    #[error("out of range")]
    OutOfRange,
}

/// Estimator of the rotor time constant, for the idle loop.
#[derive(Clone, Copy, Debug)]
pub struct Online {
    rls: Rls,
    /// Parameters of the settings, at standstill.
    nominal: Unknowns,
    tau_r: f32,
    /// Inductances of the settings, without saliency.
    machine: Machine,
    flux_saliency: f32,
    current_saliency: f32,
    /// Square of [`STEADY_CURRENT`], A².
    steady_squared: f32,
    /// Delay of the analog current filter in periods: share of the previous voltage in the effective one.
    delay: f32,
    /// Voltage of the previous period, V.
    before: AlphaBeta,
    /// Voltage of the present period, V.
    present: AlphaBeta,
    /// Filters of voltage and current before the decimation.
    filters: [Filter; 2],
    /// Sum of the filtered voltages since the last sample of the least squares.
    sum: Complex32,
    /// Filtered current at that sample.
    sampled: Complex32,
    /// Control periods since that sample.
    pushed: u8,
    unknowns: Unknowns,
    current: Dq,
    speed: f32,
    calls: u32,
}

impl Online {
    /// Estimator for the motor and the sensors of the settings.
    ///
    /// # Errors
    /// [`RlsError`] of the recursive least squares; never with settings that [`Settings::build`] accepts.
    pub fn new(settings: &Settings) -> Result<Self, RlsError> {
        let m = &settings.motor;
        let (i_d, trip_a, dc_over_v) = (settings.i_d(), settings.trip_a(), settings.dc_over_v());
        let (l_s, tau_r, steady) = (m.l_m + m.l_ls, m.tau_r(), STEADY_CURRENT * i_d);
        let sigma_l_s = l_s - m.l_m * m.l_m / m.l_r();
        let nominal = Unknowns { r_s: m.r_s, rate: 1.0 / tau_r, omega_m: 0.0 };
        // Within the range that the least squares require.
        let base = |typical: f32, limit: f32| within(typical, (0.02 * limit, limit));
        let rls = Rls::new(RlsSettings {
            lambda: LAMBDA,
            p0: P0,
            corner: TAU * CORNER_HZ * SAMPLE_S,
            voltage_base: base(settings.current_limit_a() * m.r_s, dc_over_v),
            current_base: base(i_d, trip_a),
            voltage_limit: dc_over_v,
            current_limit: trip_a,
        })?;
        let mut online = Self {
            rls,
            nominal,
            tau_r,
            machine: Machine { sigma_l_s, coupled: l_s - sigma_l_s, period: SAMPLE_S },
            flux_saliency: settings.injection.synchronous.flux_saliency,
            current_saliency: settings.current_saliency(),
            steady_squared: steady * steady,
            delay: settings.current_age_s() / PERIOD_S,
            before: AlphaBeta::ZERO,
            present: AlphaBeta::ZERO,
            filters: [Filter::new(TAU * BEFORE_HZ * PERIOD_S); 2],
            sum: Complex32::ZERO,
            sampled: Complex32::ZERO,
            pushed: 0,
            unknowns: nominal,
            current: Dq::ZERO,
            speed: 0.0,
            calls: 0,
        };
        online.restart();
        Ok(online)
    }

    /// Processes one control period, in order and without gaps: the `measured` current, A, and the
    /// `realised` voltage of the same step, V, both of [`Telemetry`](drive_core::Telemetry).
    pub fn push(&mut self, measured: AlphaBeta, realised: AlphaBeta) {
        // The voltage of a step acts from the next sample on; the analog filter delays the current.
        let voltage = self.present + (self.before - self.present) * self.delay;
        (self.before, self.present) = (self.present, realised);
        if !(voltage.is_finite() && measured.is_finite()) {
            // The filters would never recover.
            self.restart();
        } else {
            self.sample(voltage.into(), measured.into());
        }
    }

    /// Filters and decimates one control period. Not inlined: `cargo xtask cycles` finds it by its name.
    #[inline(never)]
    fn sample(&mut self, voltage: Complex32, current: Complex32) {
        let v = self.filters[0].step(voltage).value;
        let i = self.filters[1].step(current).value;
        if self.pushed == DECIMATION {
            let mean = self.sum * (1.0 / f32::from(DECIMATION));
            self.rls.step(mean.into(), self.sampled.into());
            (self.pushed, self.sum) = (0, Complex32::ZERO);
        }
        if self.pushed == 0 {
            self.sampled = i;
        }
        self.sum += v;
        self.pushed += 1;
    }

    /// Restarts after lost samples or a pause of the outputs; keeps the means of current and speed.
    pub fn restart(&mut self) {
        self.rls.reset();
        self.begin();
        (self.before, self.present) = (AlphaBeta::ZERO, AlphaBeta::ZERO);
        self.filters = [Filter::new(TAU * BEFORE_HZ * PERIOD_S); 2];
        (self.sum, self.pushed) = (Complex32::ZERO, 0);
    }

    /// Restarts the least squares from the parameters of the settings.
    fn begin(&mut self) {
        self.unknowns = Unknowns { omega_m: self.speed, ..self.nominal };
        self.rls.begin_at(self.machine().coefficients(&self.unknowns));
        self.calls = 0;
    }

    /// The machine at the mean current: L x = sigma L_s (x - s x*) with the saliency s, where x rotates with the
    /// current in the steady state.
    fn machine(&self) -> Machine {
        let Dq { d, q } = self.current;
        let square = self.current.length_squared();
        let share = if square > 1e-6 {
            let of_flux = self.flux_saliency * (d * d - q * q) / square;
            self.current_saliency * fpu_sqrt::sqrtf(square) + of_flux
        } else {
            self.flux_saliency
        };
        let sigma_l_s = self.machine.sigma_l_s;
        Machine { sigma_l_s: sigma_l_s + sigma_l_s * share, ..self.machine }
    }

    /// Advances the fit by one step and returns the estimate; to be called ten times per second. `current`
    /// is the current reference in the flux frame, A peak.
    ///
    /// Computes the sampled machine four times and solves three equations: about 2000 multiplications and
    /// additions.
    ///
    /// # Errors
    /// The reason why there is no valid estimate at present.
    pub fn refine(&mut self, current: Dq, speed: SpeedInput) -> Result<RotorEstimate, NoEstimate> {
        let (SpeedInput::Known(seen) | SpeedInput::Guess(seen)) = speed;
        let free_speed = matches!(speed, SpeedInput::Guess(_));
        if !(current.is_finite() && seen.is_finite()) {
            self.calls = 0;
            return Err(NoEstimate::Transient);
        }
        let weight = if self.calls == 0 { 1.0 } else { SMOOTHING };
        self.current += (current - self.current) * weight;
        self.speed += (seen - self.speed) * weight;
        if self.calls == 0 || !free_speed {
            self.unknowns.omega_m = self.speed;
        }
        let (most, uncertain) =
            if free_speed { (STEADY_GUESS, UNCERTAIN_GUESS) } else { (STEADY, UNCERTAIN) };
        let moved = (current - self.current).length_squared();
        let steady = (seen - self.speed).abs() < most && moved < self.steady_squared;
        if !steady {
            self.begin();
            return Err(NoEstimate::Transient);
        }
        self.calls = self.calls.saturating_add(1);
        let nominal = Unknowns { omega_m: self.speed, ..self.nominal };
        let machine = self.machine();
        let Some(fit) = machine.step(&self.rls, &self.unknowns, &nominal, free_speed) else {
            self.unknowns = nominal;
            return Err(NoEstimate::PoorExcitation);
        };
        self.unknowns = fit.unknowns;
        let Unknowns { r_s, rate, omega_m } = fit.unknowns;
        let (tau_r, uncertainty) = (1.0 / rate, fit.uncertainty);
        let ratio = tau_r / self.tau_r;
        let certain = uncertainty < uncertain && self.rls.missing() < MISSING;
        let at_rest = fit.moved < AT_REST;
        let tau_r_in_range = ratio > TAU_R_LIMITS[0] && ratio < TAU_R_LIMITS[1];
        if self.calls < SETTLE || !at_rest {
            Err(NoEstimate::Settling)
        } else if !certain {
            Err(NoEstimate::PoorExcitation)
        } else if tau_r_in_range && r_s > 0.0 && r_s < 3.0 * nominal.r_s {
            Ok(RotorEstimate { tau_r, resistance: r_s, omega_m, uncertainty })
        } else {
            self.unknowns = nominal;
            Err(NoEstimate::OutOfRange)
        }
    }

    /// The underlying recursive least squares.
    pub fn rls(&self) -> &Rls {
        &self.rls
    }
}
