//! Design of the speed loop and the position loop.

use core::f64::consts::{PI, TAU};

use super::{TuningError, bisected, check, check_period, pi_response, zero_at};
use drive_core::MotionGains;
use num_complex::Complex64;

/// Source of the rotor speed, with the data that decide how fast the speed loop may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpeedSource {
    /// Difference of two counts of an encoder.
    Encoder,
    /// Difference of two angles of a tracking loop.
    Tracking {
        /// Natural frequency of the tracking loop, Hz.
        hz: f64,
    },
    /// The speed that the angle filter and the back-EMF observer estimate.
    Estimate {
        /// Slip due to 1 A of q-axis current, mechanical turns/s.
        slip: f64,
        /// Angle by which the leakage voltage of 1 A of q-axis current turns the estimated flux if the drive neglects the leakage,
        /// mechanical turns: `sigma L_s/(2 pi p psi)` with p pole pairs.
        leakage: f64,
    },
}

/// Result of [`design_motion_loops`], with the plant it is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionDesign {
    /// The controllers.
    pub gains: MotionGains,
    /// Source of the speed for these controllers.
    pub source: SpeedSource,
}

/// Ratio of the crossover of the speed loop to the zero of its controller, and to the gain of the position loop: as in section 3.8,
/// and with an estimated speed. The smaller ratio gives the same stiffness with a lower crossover. With a ratio of 4, a coupling
/// with a resonance of 30 Hz and little damping oscillated.
const SPREAD: f64 = 4.0;
const SPREAD_ESTIMATED: f64 = 3.5;

/// Ratio of the corner of the speed low-pass to the natural frequency of the tracking loop: above it, the
/// difference of two estimated angles 10 ms apart is mostly noise.
const CORNER: f64 = 2.0;

/// Time constant of the estimated speed, s: the time constant of the mean at speeds where the observer gives the angle. (The angle
/// filter lags as much for the first 30 ms after a step of the load, and then not at all.)
const ESTIMATE_S: f64 = 5e-3;
/// Lag of the current loop, s.
const CURRENT_S: f64 = 2.4e-3;
/// Time constant of all low-passes of the estimated speed, relative to the time in which the controller responds to a leakage voltage
/// with as much current as caused it. With this ratio the loop does not oscillate even if the leakage setting is off by 100 %.
const PER_LEAKAGE: f64 = 0.7;
/// Largest slip that the controller commands, relative to the speed error that it corrects. If the rotor resistance is off by 30 %,
/// 0.3 of that slip appears as a speed error again.
const LARGEST_SLIP: f64 = 1.0;

/// Designs the speed controller k_c (z - z_c)/(z - 1) and the position gain for a rigid rotor with an
/// `acceleration` per ampere in mechanical turns/s^2, sampled with `period_s`.
///
/// The zero lies at a quarter of the crossover, as fictitious frequencies, as in section 3.8. (The crossover at -176° of
/// that rule does not exist here: G/(z - 1) is a double integrator with a lag, its phase is below -180° everywhere.) The
/// crossover is where `phase_margin_deg` is met. The phase is exact: the current is held for a period and a counted speed
/// is the mean over one, which gives the plant g T/2 (z + 1)/(z (z - 1)) with a phase of -90° - ωT. With the angles of a
/// tracking loop, the design includes a low-pass of the speed with its corner at 2 w_n, and a tracking loop that lags more
/// than the filter of the flux angle. (That filter has Butterworth poles at w_n without an observer, and is faster with
/// one.)
///
/// An estimated speed lags by 5 ms, the current loop before it by 2.4 ms, and the current is held for a period and comes half a
/// period late. Two more limits follow from other effects of a current change on the estimate. If the leakage inductance is wrong, a
/// change of the current turns the estimated flux, so a low-pass keeps the controller from responding to that. If the rotor
/// resistance is wrong, the slip is wrong, so the controller commands no more slip than the speed error that it corrects.
///
/// The position gain is a quarter of the crossover. Opened at the current, the position loop then has
/// about 8° less phase margin.
///
/// | | crossover | margin, speed | margin, position |
/// |---|---|---|---|
/// | encoder, 60°, 10 ms | 4.4 Hz | 60.0° | 52.1° |
/// | 4 Hz tracking loop, 60°, 10 ms | 1.4 Hz | 60.0° | 52.2° |
/// | estimate without slip and leakage, 60°, 1.7 ms | 4.9 Hz | 60.0° | 51.6° |
/// | the same, 45° | 9.8 Hz | 45.0° | 35.6° |
///
/// # Errors
/// An argument is out of its range.
pub fn design_motion_loops(
    acceleration: f64,
    source: SpeedSource,
    phase_margin_deg: f64,
    period_s: f64,
) -> Result<MotionDesign, TuningError> {
    check_period(period_s)?;
    check("acceleration by 1 A in turns/s^2", acceleration, 0.0, 1e9)?;
    if let SpeedSource::Tracking { hz } = source {
        check("tracking bandwidth in Hz", hz, 0.0, 1e6)?;
    }
    // The zero of the controller allows 76° at most.
    check("phase margin of the speed loop in degrees", phase_margin_deg, 20.0, 75.0)?;
    let spread = source.spread();
    let spare = libm::atan(spread) - phase_margin_deg * (PI / 180.0);
    // This is the smoothing for a crossover, rad/sample.
    let smoothing = |omega_t: f64| source.smoothing(omega_t, acceleration, period_s);
    let (low, _) = bisected((0.0, PI), 50, &|omega_t| {
        source.lag(omega_t, period_s) - low_pass(smoothing(omega_t), omega_t).arg() < spare
    });
    let low = match source {
        SpeedSource::Estimate { slip, .. } => {
            low.min(LARGEST_SLIP * acceleration / slip * period_s)
        }
        _ => low,
    };
    let (sin, cos) = libm::sincos(0.5 * low);
    let mut design = MotionDesign {
        gains: MotionGains {
            k_c: 1.0,
            z_c: zero_at(sin / cos / spread),
            k_x: low / period_s / spread,
            acceleration,
            smoothing: smoothing(low),
            period_s,
        },
        source,
    };
    design.gains.k_c = 1.0 / design.open_loop(low).norm();
    Ok(design)
}

impl SpeedSource {
    /// Returns the ratio of the crossover to the zero.
    pub fn spread(&self) -> f64 {
        match self {
            Self::Encoder | Self::Tracking { .. } => SPREAD,
            Self::Estimate { .. } => SPREAD_ESTIMATED,
        }
    }

    /// Returns the share of the newest value in the low-pass of the speed for a crossover `omega_t` of the loop, rad/sample.
    fn smoothing(&self, omega_t: f64, acceleration: f64, period_s: f64) -> f64 {
        let corner_t = match *self {
            Self::Encoder => f64::INFINITY,
            Self::Tracking { hz } => CORNER * TAU * hz * period_s,
            Self::Estimate { leakage, .. } => {
                let all_s = PER_LEAKAGE * leakage / acceleration * omega_t / period_s;
                period_s / (all_s - ESTIMATE_S).max(0.0)
            }
        };
        -libm::expm1(-corner_t)
    }

    /// Returns the lag of the speed behind the integral of the controller's current, before the low-pass, rad. It increases with the
    /// frequency `omega_t`, rad/sample.
    fn lag(&self, omega_t: f64, period_s: f64) -> f64 {
        let omega = omega_t / period_s;
        omega_t
            + match *self {
                Self::Encoder => 0.0,
                Self::Tracking { hz } => -tracked(omega / (TAU * hz)).arg(),
                Self::Estimate { .. } => omega * CURRENT_S + libm::atan(omega * ESTIMATE_S),
            }
    }
}

/// Third pole of the tracking loop relative to the double one.
const THIRD_POLE: f64 = 0.2;

/// Returns the response of the tracking loop, tracked over true rotor angle, 1 - s^3 / ((s + 1)^2 (s +
/// c)); `omega` is relative to its natural frequency.
fn tracked(omega: f64) -> Complex64 {
    let s = Complex64::new(0.0, omega);
    let (pole, third) = (s + Complex64::ONE, s + Complex64::new(THIRD_POLE, 0.0));
    Complex64::ONE - s * s * s / (pole * pole * third)
}

/// Returns the response of a first-order low-pass, share / (1 - (1 - share) z^-1).
fn low_pass(share: f64, omega_t: f64) -> Complex64 {
    let kept = Complex64::cis(-omega_t) * (1.0 - share);
    Complex64::new(share, 0.0) / (Complex64::ONE - kept)
}

impl MotionDesign {
    /// Returns the delay of the speed loop at low frequencies, s: from a speed to the current with which the controller responds,
    /// and to its torque.
    pub fn delay_s(&self) -> f64 {
        let MotionGains { smoothing, period_s, .. } = self.gains;
        let low_pass_s = period_s * (1.0 - smoothing) / smoothing;
        // At this low frequency the phase gives the delay.
        let omega_t = 1e-4;
        self.source.lag(omega_t, period_s) / omega_t * period_s + low_pass_s
    }

    /// Returns the open loop of the speed mode at `omega_t` rad/sample.
    pub fn open_loop(&self, omega_t: f64) -> Complex64 {
        let MotionGains { k_c, z_c, acceleration, smoothing, period_s: t, .. } = self.gains;
        let z = Complex64::cis(omega_t);
        let lagging = |angle: f64| Complex64::cis(-angle);
        // This is the change of the speed in a period over the current, turns/s per A.
        let step = Complex64::from(t * acceleration) / (z - Complex64::ONE);
        // This is the mean speed of a period.
        let mean = step * (Complex64::ONE + lagging(omega_t)) * 0.5;
        let speed = match self.source {
            SpeedSource::Encoder => mean,
            SpeedSource::Tracking { hz } => mean * tracked(omega_t / (t * TAU * hz)),
            SpeedSource::Estimate { .. } => {
                let omega = omega_t / t;
                step * lagging(0.5 * omega_t + omega * CURRENT_S)
                    / Complex64::new(1.0, omega * ESTIMATE_S)
            }
        };
        pi_response(k_c, z_c, omega_t) * speed * low_pass(smoothing, omega_t)
    }
}
