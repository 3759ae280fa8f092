//! Settings of the energy model, and their ranges.

use crate::error::{PlantError, check};
use crate::machine::MachineSettings;
use crate::settings::{or_zero, settings};

settings! {
    /// Differences between the iron of the energy model and a linear machine. With all of them off it is the textbook
    /// machine. Saliencies are relative to the transient inductance `sigma Ls`; positive is low inductance along the
    /// axis.
    IronSettings "iron." |s| {
        /// Flux at which `saturation` and `teeth` hold, Wb.
        psi_n: f64 = 0.124, 1e-4..=100.0, "Wb";
        /// Saturation factor of the main flux: unsaturated inductance over chord inductance at `psi_n`.
        saturation: f64 = 1.0, 1.0..=10.0, "";
        /// Exponent n of the main-flux curve `i = m/L0 (1 + (|m|/mk)^n)`.
        exponent: u32 = 6, 2.0..=12.0, "";
        /// Whether `MachineSettings::lm` is the chord inductance at `psi_n`; otherwise it is the unsaturated inductance.
        chord: bool = true;
        /// Saliency of the stator leakage by teeth that the flux saturates, at the flux `psi_n`.
        teeth: f64 = 0.0, -0.25..=0.25, "";
        /// Flux that the teeth follow: 0 rotor flux, 1 air-gap flux, a value in between a mixture of both.
        teeth_gap: f64 = 1.0, 0.0..=1.0, "";
        /// Angle by which the axis of the teeth is ahead of that flux, electrical degrees.
        teeth_turn_deg: f64 = 0.0, -90.0..=90.0, "deg";
        /// Further angle of the axis of the teeth per ampere of current across the rotor flux.
        teeth_turn_deg_per_a: f64 = 0.0, -90.0..=90.0, "deg/A";
        /// Current at which `MachineSettings::lls` and `llr` are the chord leakage inductances, A peak; at 0 they are
        /// the unsaturated ones.
        nominal_a: f64 = 0.0, 0.0..=1e4, "A";
        /// Relative decrease of the stator leakage inductance per ampere, 1/A.
        leakage_saturation: f64 = 0.0, 0.0..=50.0, "1/A";
        /// Relative decrease of the rotor leakage inductance per ampere, 1/A.
        rotor_leakage_saturation: f64 = 0.0, 0.0..=50.0, "1/A";
        /// Rotor resistance at high frequency divided by that at slip frequency (deep bars).
        skin_ratio: f64 = 1.0, 1.0..=20.0, "";
        /// Decrease of the rotor leakage inductance at high frequency, H.
        skin_leakage: f64 = 0.0;
        /// Saliency of the stator leakage that rotates with the rotor's bars.
        slots: f64 = 0.0, -0.1..=0.1, "";
        /// Number of rotor bars.
        bars: u32 = 28, 4.0..=400.0, "";
        /// Saliency of the stator leakage that is fixed to the stator (eccentricity, stator slots).
        stator_fixed: f64 = 0.0, -0.1..=0.1, "";
        /// Axis of that saliency, electrical degrees from phase a.
        stator_fixed_deg: f64 = 0.0, -180.0..=180.0, "deg";
        /// Iron-loss resistance in parallel with the magnetising branch, ohm; 0 for no iron losses.
        loss: f64 = 0.0, or_zero(s.loss, 1.0..=1e6), "ohm";
    }
}

impl IronSettings {
    /// Linear iron.
    pub const LINEAR: Self = Self::DEFAULT;

    /// Whether every term is the gradient of the energy. Only then does the power balance hold.
    pub fn conservative(&self) -> bool {
        let on_gap = self.teeth_gap == 1.0;
        let straight = self.teeth_turn_deg == 0.0 && self.teeth_turn_deg_per_a == 0.0;
        self.teeth == 0.0 || (on_gap && straight)
    }

    /// Refuses values outside their range, in a machine.
    pub(crate) fn check_in(&self, m: &MachineSettings) -> Result<(), PlantError> {
        self.check()?;
        // The remaining rotor leakage stays outside the bar.
        // The bottom of the bars must not be faster than the integration.
        let least = if self.skin_ratio > 1.0 { 1e-4 * m.rr } else { 0.0 };
        check("iron.skin_leakage", self.skin_leakage, least..=0.9 * m.llr, "H")
    }
}
