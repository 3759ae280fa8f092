//! Controller design: section 3.8 of the dissertation, evaluated exactly and checked against the physical
//! loop.
//!
//! The design uses `f64` with `libm` and runs when settings are converted to coefficients, never in the
//! control step. The design of a current loop evaluates the loop at about 1200 frequencies, or 3500 if
//! it lowers the gain. A core without `f64` arithmetic should do it once, at start.
//!
//! # The rule of section 3.8
//! For an identified plant G = k/(z - p) ([`rule_3_8`]):
//!
//! 1. the crossover is where the phase of G/(z - 1), exactly as a function of z = e^(jωT), is
//!    -(100° + atan 4) = -175.96°;
//! 2. the zero lies at a quarter of it, both as fictitious frequencies v = 2/T tan(ωT/2) (2.18), and
//!    z_c follows from Eq. 2.17 with w = -v/4 (Eq. 3.38 prints +, which puts the zero at 1.055);
//! 3. k_c makes the gain 1 there; the pole of the reference filter is p_f = z_c (3.40).
//!
//! The zero contributes atan 4 only: the source omits the atan(vT/2) of Eq. 2.27, so the actual phase at
//! the crossover is about -94°. With 76.0° (as Eq. 3.37 prints it) for atan 4, k_c is 0.12 % to 0.14 %
//! larger.
//!
//! | plant | crossover v | z_c | k_c | printed |
//! |---|---|---|---|---|
//! | Eq. 3.34 | 205.03 Hz | 0.947726 | 53.000 | 204.5 Hz, 0.94786, 52.48 (read off a graph) |
//! | Eq. 3.41, d | 180.63 Hz | 0.953803 | 66.527 | - |
//! | Eq. 3.42, q | 182.35 Hz | 0.953374 | 51.215 | - |
//!
//! # Limits of the rule
//! A first-order plant cannot represent the phase of the filter and of a delay, even if both were in the
//! loop during the identification. On the plant computed from the motor, with the filter and one period of
//! delay, the gains of the rule for Eq. 3.41 give a phase margin of 41.3° and a sensitivity peak of 2.87.
//! [`design_current_loop`] therefore lowers k_c until both meet their limits.

use core::f64::consts::{PI, TAU};

use drive_core::filter::{LPF, Section, response};
use drive_core::{FirstOrder, Motor};
use num_complex::Complex64;

mod margins;
mod motion;

pub use margins::Margins;
pub use motion::{MotionDesign, SpeedSource, design_motion_loops};

use margins::gain_limit;

/// Phase margin below which [`design_current_loop`] lowers the gain, degrees.
pub const MIN_PHASE_MARGIN_DEG: f64 = 45.0;
/// Sensitivity peak above which [`design_current_loop`] lowers the gain.
pub const MAX_MS: f64 = 2.2;
/// Delay from the sample of a current to the resulting voltage, in periods, without the hold, which is
/// part of the plant.
pub const DELAY: f64 = 1.0;

/// T-equivalent circuit of the motor per phase (Table 5), in ohm and H.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EquivalentCircuit {
    /// Stator resistance.
    pub r_s: f64,
    /// Rotor resistance.
    pub r_r: f64,
    /// Magnetising inductance.
    pub l_m: f64,
    /// Stator leakage inductance.
    pub l_ls: f64,
    /// Rotor leakage inductance.
    pub l_lr: f64,
}

impl From<Motor> for EquivalentCircuit {
    fn from(Motor { r_s, r_r, l_m, l_ls, l_lr, .. }: Motor) -> Self {
        let [r_s, r_r, l_m, l_ls, l_lr] = [r_s, r_r, l_m, l_ls, l_lr].map(f64::from);
        Self { r_s, r_r, l_m, l_ls, l_lr }
    }
}

/// Result of [`rule_3_8`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RuleDesign {
    /// Gain of the controller.
    pub k_c: f64,
    /// Zero of the controller and pole of the reference filter.
    pub z_c: f64,
    /// Crossover as a fictitious frequency (2.18), rad/s.
    pub v: f64,
}

/// Result of [`design_current_loop`], with intermediate results.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoopDesign {
    /// Gain of the controller, V/A.
    pub k_c: f64,
    /// Zero of the controller and pole of the reference filter.
    pub z_c: f64,
    /// Margins on the physical plant with `k_c`.
    pub margins: Margins,
    /// Gain by the rule of section 3.8, V/A; `k_c` is never larger.
    pub rule_k_c: f64,
    /// Margins on the physical plant with `rule_k_c`.
    pub rule_margins: Margins,
}

/// Reason why a controller could not be designed: a value is NaN or not strictly between its bounds.
// Settings are f32, so the error shows the digits of f32.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {}: must be above {} and below {}", *.value as f32, *.min as f32, *.max as f32)]
pub struct TuningError {
    /// Name of the value, with its unit.
    pub name: &'static str,
    /// The value.
    pub value: f64,
    /// Lower bound, excluded.
    pub min: f64,
    /// Upper bound, excluded.
    pub max: f64,
}

fn check(name: &'static str, value: f64, min: f64, max: f64) -> Result<(), TuningError> {
    // NaN fails the comparison.
    let holds = value > min && value < max;
    holds.then_some(()).ok_or(TuningError { name, value, min, max })
}

/// Returns the error of a loop whose crossover on the motor's plant lies below the zero of its controller, where the rule does
/// not apply, or does not exist (NaN). Either the identified plant does not belong to this motor, or the time constant of the
/// leakage is below about 4.5 periods.
fn no_crossover(crossover_hz: f64, z_c: f64, period_s: f64) -> TuningError {
    // This is the fictitious frequency of the zero.
    let zero_hz = 2.0 / period_s * (1.0 - z_c) / (1.0 + z_c) / TAU;
    let name = "crossover in Hz on the motor's plant (sigma L_s/(r_s + r_r) is too short for this control rate, or the identified plant \
                is another motor's)";
    TuningError { name, value: crossover_hz, min: zero_hz, max: 0.5 / period_s }
}

fn check_period(period_s: f64) -> Result<(), TuningError> {
    check("period in s", period_s, 1e-7, 10.0)
}

fn check_plant(k: f64, p: f64) -> Result<(), TuningError> {
    check("gain k of the plant", k, 0.0, 1e9)?;
    check("pole p of the plant", p, 0.0, 1.0)
}

/// Returns the current response of the motor, A/V, computed from its equivalent circuit: Eq. 3.14 with
/// a zero-order hold, k = (1 - p)/R', p = exp(-T R'/(σ L_s)), R' = r_s + r_r (L_m/L_r)².
///
/// Table 5 at 6 kHz: k = 0.0032052 A/V, p = 0.980053. (Eq. 3.33 prints 0.003237 and 0.8359: Eq. 3.20
/// to 3.22 contain an error of a factor 8.14, and Eq. 3.25 is the forward difference.)
///
/// # Errors
/// A parameter is not positive and finite, or the period is out of range.
pub fn motor_plant(motor: &EquivalentCircuit, period_s: f64) -> Result<FirstOrder, TuningError> {
    check_period(period_s)?;
    check("r_s in ohm", motor.r_s, 0.0, 1e9)?;
    check("r_r in ohm", motor.r_r, 0.0, 1e9)?;
    check("l_m in H", motor.l_m, 0.0, 1e6)?;
    check("l_ls in H", motor.l_ls, 0.0, 1e6)?;
    check("l_lr in H", motor.l_lr, 0.0, 1e6)?;
    let l_r = motor.l_m + motor.l_lr;
    let r = motor.r_s + motor.r_r * (motor.l_m / l_r) * (motor.l_m / l_r);
    let sigma_l_s = motor.l_m + motor.l_ls - motor.l_m * motor.l_m / l_r;
    let exponent = -period_s * r / sigma_l_s;
    let decay = -libm::expm1(exponent);
    let plant = FirstOrder { k: decay / r, p: 1.0 - decay };
    check_plant(plant.k, plant.p)?;
    Ok(plant)
}

/// Applies the rule of section 3.8 to `plant`; see the [module](self).
///
/// # Errors
/// The gain is not positive and finite, the pole is outside (0, 1), or the period is out of range.
pub fn rule_3_8(plant: FirstOrder, period_s: f64) -> Result<RuleDesign, TuningError> {
    check_period(period_s)?;
    check_plant(plant.k, plant.p)?;
    let wanted = 100.0 * (PI / 180.0) + libm::atan2(4.0, 1.0);
    // The lag of G/(z - 1) grows from 90° at dc to 360° at half the sampling rate, so there is one solution.
    let lag = |omega_t: f64| {
        let z = Complex64::cis(omega_t);
        (z - Complex64::new(plant.p, 0.0)).arg() + (0.5 * PI + 0.5 * omega_t)
    };
    let (low, _) = bisected((0.0, PI), 60, &|omega_t| lag(omega_t) < wanted);
    let (sin, cos) = libm::sincos(0.5 * low);
    let half_v_t = sin / cos;
    let z_c = zero_at(half_v_t / 4.0);
    let k_c = 1.0 / (pi_response(1.0, z_c, low) * plant.response(low)).norm();
    Ok(RuleDesign { k_c, z_c, v: 2.0 / period_s * half_v_t })
}

/// Returns the interval after `steps` bisections; `is_below` is true below the value that is sought.
pub fn bisected(
    (mut low, mut high): (f64, f64),
    steps: u32,
    is_below: &dyn Fn(f64) -> bool,
) -> (f64, f64) {
    for _ in 0..steps {
        let middle = 0.5 * (low + high);
        (low, high) = if is_below(middle) { (middle, high) } else { (low, middle) };
    }
    (low, high)
}

/// Real z with the fictitious frequency w = -2/T `half_w_t` (2.17).
fn zero_at(half_w_t: f64) -> f64 {
    (1.0 - half_w_t) / (1.0 + half_w_t)
}

/// Frequency response C(e^(j omega_t)) of the PI controller k_c (z - z_c)/(z - 1) (3.35).
pub fn pi_response(k_c: f64, z_c: f64, omega_t: f64) -> Complex64 {
    let z = Complex64::cis(omega_t);
    (z - Complex64::new(z_c, 0.0)) * k_c / (z - Complex64::ONE)
}

/// Margins of the loop of k_c (z - z_c)/(z - 1), `plant`, the cascade `filter` and [`DELAY`].
///
/// # Errors
/// A plant, gain, zero or period is out of range, or there is no crossover above 1.6e-6 of the sampling rate.
pub fn current_loop_margins(
    k_c: f64,
    z_c: f64,
    plant: FirstOrder,
    filter: &[Section],
    period_s: f64,
) -> Result<Margins, TuningError> {
    check_period(period_s)?;
    check_plant(plant.k, plant.p)?;
    check("gain k_c", k_c, 0.0, 1e9)?;
    check("zero z_c", z_c, -1.0, 1.0)?;
    let unit = current_loop(z_c, plant, filter);
    let margins = Margins::of(&|w| unit(w) * k_c, 1, period_s);
    margins.ok_or_else(|| no_crossover(f64::NAN, z_c, period_s))
}

/// Open current loop for k_c = 1.
fn current_loop(z_c: f64, plant: FirstOrder, filter: &[Section]) -> impl Fn(f64) -> Complex64 {
    move |omega_t| {
        pi_response(1.0, z_c, omega_t)
            * plant.response(omega_t)
            * response(filter, omega_t)
            * Complex64::cis(-DELAY * omega_t)
    }
}

/// Designs a current controller by section 3.8 for the `identified` plant and checks it on the `physical`
/// one (see [`motor_plant`]) with the filter [`LPF`] and one period of delay, at standstill.
///
/// If the phase margin is below 45° or the sensitivity peak above 2.2, k_c is lowered to the largest gain
/// (less 0.1 %) up to which both limits hold; the zero stays. With Table 5 and the filter of the drive,
/// Eq. 3.41 gives k_c = 55.26 V/A instead of 66.53, margin 48.1°, peak 2.20 at 316 Hz; Eq. 3.42 stays at
/// 51.2 V/A with 50.1° and 2.03.
///
/// # Errors
/// A plant or the period is out of range, or the crossover lies below the zero of the controller.
pub fn design_current_loop(
    identified: FirstOrder,
    physical: FirstOrder,
    period_s: f64,
) -> Result<CurrentLoopDesign, TuningError> {
    let RuleDesign { k_c: rule_k_c, z_c, .. } = rule_3_8(identified, period_s)?;
    let margins_with = |k_c| current_loop_margins(k_c, z_c, physical, &LPF.sections, period_s);
    let rule_margins = margins_with(rule_k_c)?;
    let (k_c, margins) = if rule_margins.stable
        && rule_margins.phase_margin_deg >= MIN_PHASE_MARGIN_DEG
        && rule_margins.ms <= MAX_MS
    {
        (rule_k_c, rule_margins)
    } else {
        let open_loop = current_loop(z_c, physical, &LPF.sections);
        let limit = gain_limit(&open_loop, MIN_PHASE_MARGIN_DEG, MAX_MS);
        let k_c = f64::min(limit, rule_k_c) * 0.999;
        (k_c, margins_with(k_c)?)
    };
    let below_zero = no_crossover(margins.crossover_hz, z_c, period_s);
    let design = CurrentLoopDesign { k_c, z_c, margins, rule_k_c, rule_margins };
    let is_above_zero = margins.crossover_hz > below_zero.min;
    is_above_zero.then_some(design).ok_or(below_zero)
}
