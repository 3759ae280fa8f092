//! Design of the speed loop and the position loop.

use core::f64::consts::{PI, TAU};

use super::{TuningError, bisected, check, check_period, pi_response, zero_at};
use drive_core::MotionGains;
use num_complex::Complex64;

/// Result of [`design_motion_loops`], with the plant it is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionDesign {
    /// The controllers.
    pub gains: MotionGains,
    /// Natural frequency of the tracking loop, rad/s; `None` with an encoder.
    pub tracking: Option<f64>,
}

/// Ratio of the crossover of the speed loop to the zero of its controller (4 in section 3.8 as well), and
/// to the gain of the position loop.
const SPREAD: f64 = 4.0;

/// Ratio of the corner of the speed low-pass to the natural frequency of the tracking loop: above it, the
/// difference of two estimated angles 10 ms apart is mostly noise.
const CORNER: f64 = 2.0;

/// Designs the speed controller k_c (z - z_c)/(z - 1) and the position gain for a rigid rotor with an
/// `acceleration` per ampere in mechanical turns/s^2, sampled with `period_s`. `tracking_hz` is the natural
/// frequency of the tracking loop, `None` with an encoder.
///
/// The zero lies at a quarter of the crossover, as fictitious frequencies, as in section 3.8. (The
/// crossover at -176° of that rule does not exist here: G/(z - 1) is a double integrator with a lag, its
/// phase is below -180° everywhere.) The crossover is where `phase_margin_deg` is met. The phase is exact:
/// the current is held for a period and the speed is the mean over one, which gives the plant
/// g T/2 (z + 1)/(z (z - 1)) with a phase of -90° - ωT. Without an encoder a low-pass of the speed with its
/// corner at 2 w_n is included, and a tracking loop that lags more than the filter of the flux angle: that
/// has Butterworth's poles at w_n without an observer, and is faster with it.
///
/// The position gain is a quarter of the crossover. Opened at the current, the position loop then has some
/// 8° less phase margin.
///
/// | | crossover | margin, speed | margin, position |
/// |---|---|---|---|
/// | encoder, 60°, 10 ms | 4.4 Hz | 60.0° | 52.1° |
/// | 4 Hz tracking loop, 60°, 10 ms | 1.4 Hz | 60.0° | 52.2° |
///
/// # Errors
/// An argument is out of its range.
pub fn design_motion_loops(
    acceleration: f64,
    tracking_hz: Option<f64>,
    phase_margin_deg: f64,
    period_s: f64,
) -> Result<MotionDesign, TuningError> {
    check_period(period_s)?;
    check("acceleration by 1 A in turns/s^2", acceleration, 0.0, 1e9)?;
    check("tracking bandwidth in Hz", tracking_hz.unwrap_or(1.0), 0.0, 1e6)?;
    // The zero leaves 76° at most.
    check("phase margin of the speed loop in degrees", phase_margin_deg, 20.0, 75.0)?;
    let tracking = tracking_hz.map(|hz| TAU * hz);
    let smoothing = tracking.map_or(1.0, |w_n| -libm::expm1(-CORNER * w_n * period_s));

    let spare = libm::atan2(SPREAD, 1.0) - phase_margin_deg * (PI / 180.0);
    // Increases with the frequency.
    let lag = |omega_t: f64| {
        let tracked = tracking.map_or(Complex64::ONE, |w_n| tracked(omega_t / (period_s * w_n)));
        omega_t - tracked.arg() - low_pass(smoothing, omega_t).arg()
    };
    let (low, _) = bisected((0.0, PI), 50, &|omega_t| lag(omega_t) < spare);
    let (sin, cos) = libm::sincos(0.5 * low);
    let mut design = MotionDesign {
        gains: MotionGains {
            k_c: 1.0,
            z_c: zero_at(sin / cos / SPREAD),
            k_x: low / period_s / SPREAD,
            acceleration,
            smoothing,
            period_s,
        },
        tracking,
    };
    design.gains.k_c = 1.0 / design.open_loop(low).norm();
    Ok(design)
}

/// Third pole of the tracking loop relative to the double one.
const THIRD_POLE: f64 = 0.2;

/// Response of the tracking loop, tracked over true rotor angle, 1 - s^3 / ((s + 1)^2 (s + c)); `omega`
/// relative to its natural frequency.
fn tracked(omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    let (pole, third) = (s + Complex64::ONE, s + Complex64::new(THIRD_POLE, 0.0));
    Complex64::ONE - s * s * s / (pole * pole * third)
}

/// Response of a first-order low-pass, share / (1 - (1 - share) z^-1).
fn low_pass(share: f64, omega_t: f64) -> Complex64 {
    let kept = Complex64::cis(-omega_t) * (1.0 - share);
    Complex64::new(share, 0.0) / (Complex64::ONE - kept)
}

impl MotionDesign {
    /// Open loop of the speed mode at `omega_t` rad/sample.
    pub fn open_loop(&self, omega_t: f64) -> Complex64 {
        let MotionGains { k_c, z_c, acceleration, smoothing, period_s: t, .. } = self.gains;
        let z = Complex64::cis(omega_t);
        // The observed position over the current, turns/A.
        let rigid = (z + Complex64::ONE) * (0.5 * t * t * acceleration)
            / ((z - Complex64::ONE) * (z - Complex64::ONE));
        let rotor = self.tracking.map_or(rigid, |w_n| rigid * tracked(omega_t / (t * w_n)));
        // The filtered speed over the position, 1/s.
        let difference = (Complex64::ONE - Complex64::cis(-omega_t)) * (1.0 / t);
        pi_response(k_c, z_c, omega_t) * rotor * (difference * low_pass(smoothing, omega_t))
    }
}
