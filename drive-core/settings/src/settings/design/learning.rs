//! Plan of the saliency self-commissioning: lead of the flux, points and their times.

use core::f32::consts::PI;

use drive_core::table::{Grid, POINTS};
use drive_core::{Learning, Motor, periods};

/// Largest number of half turns for which a point may last beyond the averaging time.
const MOST_HALVES: f32 = 3.0;
/// Allowed rest of a change of the flux behind the settling of a point, relative to the flux.
const LEFT: f32 = 0.02;
/// Least tangent of the lead of the flux: 5.7°. A larger lead reaches the second zero of the signal at a smaller q-axis current. A
/// smaller lead gives a noisier sensitivity and does not show how near that zero is: with 4.6° a drive accepted a torque at which it
/// then lost the lock.
const LEAST_TAN_LEAD: f32 = 0.1;
/// Largest tangent that half a step may give, 15°, and the tangent that is used if it gives more. Then the d-axis current
/// is small, and the flux slips at every lead below half a step.
const MOST_TAN_LEAD: f32 = 0.27;
const LONE_TAN_LEAD: f32 = 0.2;

/// Returns the self-commissioning of a motor with the d-axis current `i_d`, A, and currents up to `largest_a`, A peak, at the q-axis
/// currents of `grid`. `sign`: the sign of the saliency along the injection axis, if the signal is the saliency; `None` if it is a
/// current difference.
pub(crate) fn plan(
    motor: &Motor,
    i_d: f32,
    largest_a: f32,
    grid: Grid,
    sign: Option<f32>,
) -> Learning {
    let most = libm::sqrtf(largest_a * largest_a - i_d * i_d) / grid.step_a();
    let coupled = motor.coupled_inductance();
    let half_step = 0.5 * grid.step_a() / i_d;
    let tan_lead = if half_step > MOST_TAN_LEAD {
        LONE_TAN_LEAD
    } else {
        let odd = 2.0 * libm::ceilf(0.5 * (LEAST_TAN_LEAD / half_step - 1.0)) + 1.0;
        half_step * odd.max(1.0)
    };
    // With any rounding, a grid up to the largest q-axis current contains that current as a point.
    let points = ((most + 1e-3) as usize).min(POINTS - 1);
    let lead = libm::atanf(tan_lead);
    // The flux makes a half turn in the time pi tau_r i_d / i_q.
    let half_turn_s = PI * motor.tau_r() * i_d / grid.step_a();
    let first = libm::ceilf(half_turn_s / Learning::AVERAGE_S) as usize + Learning::TURNING - 1;
    let first = first.min(points);
    let slowest = first.saturating_sub(Learning::TURNING - 1).max(1) as f32;
    Learning {
        longest: periods(Learning::AVERAGE_S + MOST_HALVES * half_turn_s / slowest),
        first,
        grid,
        points,
        normalised: sign.is_some(),
        sign: sign.unwrap_or(1.0),
        lead,
        flux_t: [2.0, 2.0 * points as f32].map(|steps| {
            let change = steps * grid.step_a() * libm::sinf(lead) / i_d;
            libm::logf(change / LEFT)
        }),
        i_d,
        tau_r: motor.tau_r(),
        leakage: motor.l_ls + motor.l_m - coupled,
        coupled,
    }
}
