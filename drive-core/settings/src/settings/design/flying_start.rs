//! Coefficients of the flying start.

use crate::settings::Settings;
use drive_core::blocks::Catch;
use drive_core::flux::{FlyingStart, Path};
use drive_core::{PERIOD_S, periods};

/// Largest current while the flux builds up, as a share of the current limit, and that of the speed search as a share of it. A larger one
/// brakes a light shaft before its speed is found.
const BUILD_SHARE: f32 = 0.714;
const SEARCH_SHARE: f32 = 0.4;
/// Time of the search in a fixed frame, s. In a rotating one: rotor time constants, and the range, s.
const SEARCH_S: f32 = 0.25;
const SEARCH_T: f32 = 4.0;
const ROTATING_S: (f32, f32) = (0.12, 0.25);
/// Rated frequency up to which the fixed frame shows each speed of a motor, Hz, and the highest speed relative to the rated one.
const FIXED_HZ: f32 = 80.0;
const FASTEST_SHARE: f32 = 1.1;
/// Slip, times the rotor time constant, up to which the flux builds up in a rotating frame.
const NEAR_T: f32 = 2.0;
/// Share of the trip current that the voltage of a residual flux may drive through the proportional part of the controller. In a frame that
/// rotates with the flux the integral part lets it rise to 0.7.
const SHARE_OF_TRIP: f32 = 0.42;
/// Time in which the flux of a rotating rotor builds up, and until which the injection alone corrects the angle, s.
const BUILD_UP_S: f32 = 0.5;
const INJECTION_ONLY_S: f32 = 0.2;
/// Number of rotor time constants after which no flux is left in a motor that was switched off.
const FLUX_DECAY_T: f32 = 4.0;

impl Settings {
    /// Returns the flying start; none if there is no observer that can follow the shaft.
    pub(super) fn flying_start(&self, k_c: [f32; 2]) -> Option<FlyingStart> {
        let (tau_r, i_d) = (self.motor.tau_r(), self.i_d());
        let current = f32::max(BUILD_SHARE * self.current_limit_a(), i_d);
        let rated_hz = self.nameplate.frequency_hz;
        let search_current = SEARCH_SHARE * current;
        let path = Path::new(&self.motor, 0.5 * (k_c[0] + k_c[1]));
        let built =
            Catch::IN_BUILD.filter(|_| self.uses_observer() && self.sequence.flying_start)?;
        Some(FlyingStart {
            built,
            search_current,
            current,
            search: [SEARCH_S, (SEARCH_T * tau_r).clamp(ROTATING_S.0, ROTATING_S.1)].map(periods),
            fastest: if rated_hz > FIXED_HZ { FASTEST_SHARE * PERIOD_S * rated_hz } else { 0.0 },
            near: NEAR_T * PERIOD_S / (core::f32::consts::TAU * tau_r),
            injection_only: periods(INJECTION_ONLY_S),
            build_up: periods(BUILD_UP_S),
            flux_decay: periods(FLUX_DECAY_T * tau_r),
            path,
            residual_v: path.resistance * (SHARE_OF_TRIP * self.trip_a()),
            decay: PERIOD_S / tau_r,
        })
    }
}
