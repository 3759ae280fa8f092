//! The coefficients of a start on a turning shaft.

use crate::settings::Settings;
use drive_core::flux::Path;
use drive_core::{Catching, PERIOD_S, periods};

/// Current that the rotor is looked for with, as a share of the current limit.
const SEARCH_SHARE: f32 = 0.714;
/// Share of the current that trips up to which both together may come.
const SHARE_OF_TRIP: f32 = 0.7;
/// Time in which the flux of a turning rotor builds up, and until then the injection alone corrects the angle, s.
const BUILT_S: f32 = 0.5;
const ALONE_S: f32 = 0.2;
/// Rotor time constants after which no flux is left in a motor that was switched off.
const FLUX_GONE_T: f32 = 4.0;

impl Settings {
    /// The start on a turning shaft, where the observer can follow it.
    pub(super) fn catching(&self, k_c: [f32; 2]) -> Option<Catching> {
        let (tau_r, i_d) = (self.motor.tau_r(), self.i_d());
        let current = f32::max(SEARCH_SHARE * self.current_limit_a(), i_d);
        let path = Path::new(&self.motor, 0.5 * (k_c[0] + k_c[1]));
        (self.uses_observer() && self.sequence.catch).then(|| Catching {
            current,
            alone: periods(ALONE_S),
            built: periods(BUILT_S),
            flux_gone: periods(FLUX_GONE_T * tau_r),
            path,
            left_v: path.resistance
                * (SHARE_OF_TRIP * self.trip_a() - Catching::WITH_FLUX * current),
            decay: PERIOD_S / tau_r,
        })
    }
}
