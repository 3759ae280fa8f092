//! The rotor time constant, and the speed, from the terminals while the drive runs.
//!
//! ```text
//! control step, 6 kHz: measured current, realised voltage -> ring
//! idle loop:           ring -> Online::push (filters, recursive least squares) -> Online::refine, 10 Hz
//!                      -> Command::RotorTimeConstant
//! ```
//!
//! [`Rls`] condenses the last 1.7 s into four complex coefficients and their covariance. They are
//! not inverted one by one (Model D): while the drive runs, three sinusoids at most excite four complex
//! unknowns, and the inverse reads the speed wrong by a factor of two on data of a simulation without
//! any noise. [`refine`](Online::refine) instead fits the *machine* to them, weighted by the
//! covariance: what the data do not fix carries no weight. Of the machine the inductances are taken
//! from the settings, and these are free:
//!
//! * the stator resistance, which takes up the dead time that is left uncompensated: the sign of a
//!   sinusoidal current has a fundamental in phase with it, and acts like a resistance;
//! * 1 / tau_r;
//! * the speed, where no encoder gives it. Then the flux must not stand still: in the steady state
//!   speed and rotor resistance show as the slip alone, and the answer is [`NoEstimate::PoorExcitation`]
//!   until the magnetising current is moved, by ±0.2 A at 2 Hz for example
//!   ([`Command::Magnetising`](crate::Command::Magnetising)). The speed of the injection's tracking
//!   loop is no substitute: the believed slip is in it.
//!
//! Where speed or torque change there is no one machine, and what was learnt is forgotten: three seconds
//! of steady running give the next estimate. Measured on the simulated motor with the encoder, over
//! steps of the torque between -2 A and 3 A, 0 to 150 rpm, up to half of the dead time left and a
//! rotor of 0.8 to 1.3 times the resistance in the settings: every estimate that is given is within 6 %.
//!
//! It costs an estimated 200 cycles of a Cortex-M4 per control period and 1000 more in every eighth, 2 MHz in
//! all, and the fit ten times a second.
//!
//! The saliency makes the transient inductance look larger along the current; with the sensorless
//! settings' two numbers that is taken into account (left out, tau_r is 11 % low at 2 A).

mod fit;

use core::f32::consts::TAU;
use core::fmt;

use crate::flux::indirect::TAU_R_LIMITS;
use crate::identify::rls::filter::Filter;
use crate::identify::rls::{Rls, RlsError, RlsSettings};
use crate::io::PERIOD_S;
use crate::math::frames::{AlphaBeta, Dq};
use crate::settings::Settings;
use fit::{Machine, Unknowns};
use num_complex::Complex32;

/// Control periods to one sample of the least squares: 750 Hz. At 6 kHz the increments, which carry
/// the rotor, would be a thousandth of the signals.
const DECIMATION: u8 = 8;
/// Sampling period of the least squares, s.
pub const SAMPLE_S: f32 = DECIMATION as f32 * PERIOD_S;
/// Corner of the filters before the decimation, Hz: the carrier comes through 27 000 times smaller.
const BEFORE_HZ: f32 = 20.0;
/// Corner of the filters of the least squares, Hz. They keep out the harmonics of the dead time; of
/// the fundamental enough comes through up to some 20 Hz.
const CORNER_HZ: f32 = 10.0;
/// Memory of 1250 samples, 1.7 s.
const LAMBDA: f32 = 0.9992;
/// Initial covariance in units of the bases.
const P0: f32 = 1e6;
/// Weight of a call of `refine` in the means of current and speed: the memory at ten calls a second.
const SMOOTHING: f32 = 0.06;
/// Calls of `refine` until the memory is full once.
const SETTLE: u32 = 30;
/// Largest change of the speed within the memory, electrical rad/s: faster, there is no one machine.
const STEADY: f32 = 3.0;
/// The same where the speed is a guess: the tracking loop moves with the flux.
const STEADY_GUESS: f32 = 12.0;
/// The same of the reference of the current, as a share of the magnetising current. The saliency moves
/// with the current, and what is left of the dead time does not grow with it: a step of 2 A put 24 %
/// on tau_r.
const STEADY_CURRENT: f32 = 0.25;
/// Samples that may be missing in a row.
const MISSING: u32 = 75;
/// Largest last step of the fit, as a share of the rate, with which tau_r is published.
const AT_REST: f32 = 0.04;
/// Largest relative uncertainty of tau_r that is published. It is that of the noise alone: where it is
/// larger, what is systematic is larger still. At standstill with a slip below 0.3 Hz tau_r was 80 %
/// off where 4 % were said; where 1 % was said, 6 % at most.
const UNCERTAIN: f32 = 0.01;
/// The same where the speed is estimated, with a magnetising current that moves.
const UNCERTAIN_GUESS: f32 = 0.04;

/// What else is known of the speed, electrical rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpeedInput {
    /// By an encoder: it is not estimated.
    Known(f32),
    /// By the tracking loop of the injection: the fit begins there.
    Guess(f32),
}

/// An estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorEstimate {
    /// Rotor time constant, s.
    pub tau_r: f32,
    /// Stator resistance and what looks like one: the dead time that is left, over the current, ohm.
    pub resistance: f32,
    /// Speed of the rotor, electrical rad/s: what was given, or the estimate.
    pub omega_m: f32,
    /// Relative uncertainty of tau_r by the noise.
    pub uncertainty: f32,
}

/// Why there is no estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoEstimate {
    /// The memory is not full yet since the start, or since samples were missing.
    Settling,
    /// Speed or current changed: what was learnt before is forgotten.
    Transient,
    /// The signals do not tell tau_r (and the speed) apart from the rest.
    PoorExcitation,
    /// tau_r outside [`TAU_R_LIMITS`] times that of the settings, or a resistance below zero or above
    /// three times that of the settings.
    OutOfRange,
}

impl fmt::Display for NoEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Settling => "settling",
            Self::Transient => "speed or torque change",
            Self::PoorExcitation => "the excitation is too poor",
            Self::OutOfRange => "out of range",
        })
    }
}

/// The estimator. It lives in the idle loop.
#[derive(Clone, Copy, Debug)]
pub struct Online {
    rls: Rls,
    motor: MotorModel,
    /// Share of the voltage of the period before: the delay of the current's analog filter.
    delay: f32,
    before: AlphaBeta,
    present: AlphaBeta,
    filters: [Filter; 2],
    /// Sum of the filtered voltages since the last sample, and the filtered current then.
    sum: Complex32,
    sampled: Complex32,
    pushed: u8,
    unknowns: Unknowns,
    current: Dq,
    speed: f32,
    calls: u32,
}

/// `base`, but with `limit` no more than 50 times as large, and no less: what the least squares ask for, for
/// any motor that the drive takes.
fn between(base: f32, limit: f32) -> f32 {
    if base > limit {
        limit
    } else if base < 0.02 * limit {
        0.02 * limit
    } else {
        base
    }
}

const fn squared(x: f32) -> f32 {
    x * x
}

/// What is taken from the settings.
#[derive(Clone, Copy, Debug)]
struct MotorModel {
    r_s: f32,
    tau_r: f32,
    sigma_l_s: f32,
    l_s: f32,
    flux_saliency: f32,
    current_saliency: f32,
    /// Square of [`STEADY_CURRENT`], A².
    steady_squared: f32,
}

impl MotorModel {
    /// What the settings say, with this speed, electrical rad/s.
    fn nominal(&self, omega_m: f32) -> Unknowns {
        Unknowns { r_s: self.r_s, rate: 1.0 / self.tau_r, omega_m }
    }

    /// The machine's inductances with `current`, A: L x = sigma L_s (x - s x*), and x turns with the
    /// current in the steady state.
    fn machine(&self, current: Dq) -> Machine {
        let square = current.length_squared();
        let along = current.d * current.d - current.q * current.q;
        let share = if square > 1e-6 {
            self.current_saliency * libm::sqrtf(square) + self.flux_saliency * along / square
        } else {
            self.flux_saliency
        };
        let more = self.sigma_l_s * share;
        Machine {
            sigma_l_s: self.sigma_l_s + more,
            coupled: self.l_s - self.sigma_l_s,
            period: SAMPLE_S,
        }
    }
}

impl Online {
    /// For the motor and the sensors of these settings.
    ///
    /// # Errors
    /// What the recursive least squares refuse: nothing of settings that
    /// [`build`](Settings::build) takes.
    pub fn new(settings: &Settings) -> Result<Self, RlsError> {
        let (m, limits) = (&settings.motor, &settings.limits);
        let synchronous = &settings.injection.synchronous;
        let l_s = m.l_m + m.l_ls;
        let motor = MotorModel {
            r_s: m.r_s,
            tau_r: m.tau_r(),
            sigma_l_s: l_s - m.l_m * m.l_m / m.l_r(),
            l_s,
            flux_saliency: synchronous.flux_saliency,
            current_saliency: synchronous.current_saliency,
            steady_squared: squared(STEADY_CURRENT * settings.sequence.i_d),
        };
        let rls = Rls::new(RlsSettings {
            lambda: LAMBDA,
            p0: P0,
            corner: TAU * CORNER_HZ * SAMPLE_S,
            voltage_base: between(limits.current_a * m.r_s, limits.dc_over_v),
            current_base: between(settings.sequence.i_d, limits.trip_a),
            voltage_limit: limits.dc_over_v,
            current_limit: limits.trip_a,
        })?;
        let mut online = Self {
            rls,
            motor,
            delay: settings.scales.current_delay_s / PERIOD_S,
            before: AlphaBeta::ZERO,
            present: AlphaBeta::ZERO,
            filters: [Filter::new(TAU * BEFORE_HZ * PERIOD_S); 2],
            sum: Complex32::ZERO,
            sampled: Complex32::ZERO,
            pushed: 0,
            unknowns: motor.nominal(0.0),
            current: Dq::ZERO,
            speed: 0.0,
            calls: 0,
        };
        online.restart();
        Ok(online)
    }

    /// One control period, in order and without gaps: the current that was measured, A, and the voltage
    /// that the same step put out, V ([`Telemetry`](crate::Telemetry) has both).
    pub fn push(&mut self, measured: AlphaBeta, realised: AlphaBeta) {
        // What a step puts out acts from the next sample on; the current is seen later still.
        let voltage = self.present + (self.before - self.present) * self.delay;
        (self.before, self.present) = (self.present, realised);
        if !(voltage.is_finite() && measured.is_finite()) {
            // Inside the filters they would never leave.
            self.restart();
        } else {
            self.sample(voltage.into(), measured.into());
        }
    }

    /// The work of a control period. Not inlined: `cargo xtask cycles` counts it by its name.
    #[inline(never)]
    fn sample(&mut self, voltage: Complex32, current: Complex32) {
        let [on_voltage, on_current] = &mut self.filters;
        let v = on_voltage.step(voltage).value;
        let i = on_current.step(current).value;
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

    /// Samples were lost, or the outputs were off: begins anew, but with what it believes.
    pub fn restart(&mut self) {
        self.rls.reset();
        self.begin();
        (self.before, self.present) = (AlphaBeta::ZERO, AlphaBeta::ZERO);
        self.filters = [Filter::new(TAU * BEFORE_HZ * PERIOD_S); 2];
        (self.sum, self.pushed) = (Complex32::ZERO, 0);
    }

    /// The least squares begin anew with what is believed.
    fn begin(&mut self) {
        let nominal = self.motor.nominal(self.speed);
        self.rls.begin_at(self.motor.machine(self.current).coefficients(&nominal));
        self.unknowns = nominal;
        self.calls = 0;
    }

    /// Takes the fit one step on; call it ten times a second. `current` is the reference in the flux
    /// frame, A.
    ///
    /// Four times the sampled machine and a system of three equations, about 2000 multiplications and
    /// additions.
    ///
    /// # Errors
    /// Why the estimate must not be used now.
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
        let steady = (seen - self.speed).abs() < most && moved < self.motor.steady_squared;
        if !steady {
            self.begin();
            return Err(NoEstimate::Transient);
        }
        self.calls = self.calls.saturating_add(1);
        let nominal = self.motor.nominal(self.speed);
        let machine = self.motor.machine(self.current);
        let Some(fit) = machine.step(&self.rls, &self.unknowns, &nominal, free_speed) else {
            self.unknowns = nominal;
            return Err(NoEstimate::PoorExcitation);
        };
        self.unknowns = fit.unknowns;
        let Unknowns { r_s, rate, omega_m } = fit.unknowns;
        let (tau_r, uncertainty) = (1.0 / rate, fit.uncertainty);
        let ratio = tau_r / self.motor.tau_r;
        let certain = uncertainty < uncertain && self.rls.missing() < MISSING;
        let at_rest = fit.moved < AT_REST;
        if self.calls < SETTLE || !at_rest {
            Err(NoEstimate::Settling)
        } else if !certain {
            Err(NoEstimate::PoorExcitation)
        } else if ratio > TAU_R_LIMITS[0]
            && ratio < TAU_R_LIMITS[1]
            && r_s > 0.0
            && r_s < 3.0 * nominal.r_s
        {
            Ok(RotorEstimate { tau_r, resistance: r_s, omega_m, uncertainty })
        } else {
            self.unknowns = nominal;
            Err(NoEstimate::OutOfRange)
        }
    }

    /// The recursive least squares behind it.
    pub fn rls(&self) -> &Rls {
        &self.rls
    }
}
