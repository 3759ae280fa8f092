//! Times and threshold of the saliency check.

use drive_core::protect::SaliencyCheck;
use drive_core::{SQRT_3, periods};

/// Settling time of the averages of the demodulation, s.
const SETTLE_S: f32 = 0.020;
/// Delay of the averages, s, by which the flux that they show is earlier.
const DELAY_S: f32 = 0.004;
/// Averaging time in rotor time constants, and its limits, s. A longer average would contain less flux.
const AVERAGE_T: f32 = 0.645;
const AVERAGE_S: (f32, f32) = (0.03, 0.4);
/// Time to build the flux up again, in rotor time constants, after which it is within 5 %.
const RESTORE_T: f32 = 2.4;
/// Least time to build the flux up again, s: five time constants of the mean injection current that the lock monitor uses
/// afterwards.
const RESTORE_S: f32 = 0.25;

/// Returns the mean saliency at 60° over a window of length w of the decaying flux, relative to the saliency at nominal flux.
///
/// The flux-fixed saliency is assumed to follow 2 r/(1 + r) with the square r = e^(-2t/tau_r) of the relative flux. The
/// mean from t_0 to t_1 = t_0 + w is 0.866 (tau_r/w) ln((1 + e^(-2 t_0/tau_r)) / (1 + e^(-2 t_1/tau_r))): 0.54 with the
/// dissertation's motor.
fn seen_share(window: f32, tau_r: f32) -> f32 {
    let begin = SETTLE_S - DELAY_S;
    let sum = |t: f32| 1.0 + libm::expf(-2.0 * t / tau_r);
    0.5 * SQRT_3 * tau_r / window * libm::logf(sum(begin) / sum(begin + window))
}

/// Returns the check for a flux-fixed saliency (with its sign) and the rotor time constant `tau_r`, s.
pub(crate) fn design(flux_saliency: f32, tau_r: f32) -> SaliencyCheck {
    let window = (AVERAGE_T * tau_r).clamp(AVERAGE_S.0, AVERAGE_S.1);
    let (average, seen_share) = (periods(window), seen_share(window, tau_r));
    SaliencyCheck {
        settle: periods(SETTLE_S),
        average,
        restore: periods((RESTORE_T * tau_r).max(RESTORE_S)),
        least: SaliencyCheck::LEAST_SHARE * seen_share * flux_saliency,
        seen_share,
        per_average: 1.0 / average as f32,
    }
}
