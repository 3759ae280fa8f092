//! Settings of the loop of the dissertation.

use crate::carrier::DemodulatorKind;
use crate::table::ReferenceTable;

/// Settings of the loop of the dissertation, which a build without the feature `printed` does not use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrintedSettings {
    /// The selected demodulator; the synchronous one selects the [filter](crate::flux::FilterLoop).
    pub demodulator: DemodulatorKind,
    /// Length of the rms filters of the impedance demodulator, samples.
    pub rms_samples: u8,
    /// Current difference equivalent to an impedance difference of that demodulator, A/ohm.
    pub ampere_per_ohm: f32,
    /// Lag of the band-pass, samples, for demodulators that rotate after it.
    pub band_pass_lag: f32,
    /// Reference of the current difference above a q-axis current (section 3.3), both A.
    pub reference_a: (f32, f32),
    /// Learned reference over the q-axis current, A, in place of the constant one.
    pub learned: Option<ReferenceTable>,
    /// Gain, rad/A, and zero of the PII controller, Eq. 3.44.
    pub k_s: f32,
    /// See `k_s`.
    pub z_s: f32,
    /// Largest frequency of the axis, electrical turns per period, below 1/2.
    pub limit: f32,
}
