//! Coefficients of the flying start.

use crate::settings::Settings;
use drive_core::blocks::Catch;
use drive_core::flux::{FlyingStart, Path};
use drive_core::{PERIOD_S, periods};

/// Current of the speed search, as a share of the current limit.
const SEARCH_SHARE: f32 = 0.714;
/// Share of the trip current up to which the search current and the current of a residual flux may add up.
const SHARE_OF_TRIP: f32 = 0.7;
/// Time in which the flux of a rotating rotor builds up, and until which the injection alone corrects the angle, s.
const BUILD_UP_S: f32 = 0.5;
const INJECTION_ONLY_S: f32 = 0.2;
/// Number of rotor time constants after which no flux is left in a motor that was switched off.
const FLUX_DECAY_T: f32 = 4.0;

impl Settings {
    /// Returns the flying start; none if there is no observer that can follow the shaft.
    pub(super) fn flying_start(&self, k_c: [f32; 2]) -> Option<FlyingStart> {
        let (tau_r, i_d) = (self.motor.tau_r(), self.i_d());
        let current = f32::max(SEARCH_SHARE * self.current_limit_a(), i_d);
        let path = Path::new(&self.motor, 0.5 * (k_c[0] + k_c[1]));
        let built = Catch::IN_BUILD.filter(|_| self.uses_observer() && self.sequence.catch)?;
        Some(FlyingStart {
            built,
            current,
            injection_only: periods(INJECTION_ONLY_S),
            build_up: periods(BUILD_UP_S),
            flux_decay: periods(FLUX_DECAY_T * tau_r),
            path,
            residual_v: path.resistance
                * (SHARE_OF_TRIP * self.trip_a() - FlyingStart::WITH_FLUX * current),
            decay: PERIOD_S / tau_r,
        })
    }
}
