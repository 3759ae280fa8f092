//! Design of the controllers: everything of [`drive_design::tuning`], with this drive's filter in the
//! current loop.

pub use drive_design::tuning::*;

use crate::filters::LPF;

/// Current controller by section 3.8 with the filter [`LPF`] in the loop: see
/// [`drive_design::tuning::design_current_loop`].
///
/// # Errors
/// See there.
#[inline]
pub fn design_current_loop(
    identified: FirstOrder,
    physical: FirstOrder,
    period_s: f64,
) -> Result<CurrentLoopDesign, TuningError> {
    drive_design::tuning::design_current_loop(identified, physical, &LPF.sections, period_s)
}
