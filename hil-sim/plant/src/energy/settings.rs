//! Settings of the energy model, and their ranges.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::machine::MachineSettings;

/// What makes the iron of the energy model differ from a linear machine. All off, it is the textbook
/// machine. Saliencies are relative to the transient inductance `sigma Ls`; positive is low inductance along the axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IronSettings {
    /// Flux at which `saturation` and `teeth` hold, Wb.
    pub psi_n: f64,
    /// Saturation factor of the main flux: unsaturated inductance over chord inductance at `psi_n`.
    pub saturation: f64,
    /// Exponent n of the main-flux curve `i = m/L0 (1 + (|m|/mk)^n)`.
    pub exponent: u32,
    /// Whether `MachineSettings::lm` is the chord inductance at `psi_n`; else it is the unsaturated one.
    pub chord: bool,
    /// Saliency of the stator leakage by teeth that the flux saturates, at the flux `psi_n`.
    pub teeth: f64,
    /// Flux that the teeth follow: 0 rotor flux, 1 air-gap flux, part of the way between.
    pub teeth_gap: f64,
    /// Angle by which the axis of the teeth is ahead of that flux, electrical degrees.
    pub teeth_turn_deg: f64,
    /// The same, per ampere of current across the rotor flux.
    pub teeth_turn_deg_per_a: f64,
    /// Relative loss of the stator leakage inductance per ampere, 1/A.
    pub leakage_saturation: f64,
    /// The same of the rotor leakage, 1/A.
    pub rotor_leakage_saturation: f64,
    /// Rotor resistance at high frequency over that at slip frequency (deep bars).
    pub skin_ratio: f64,
    /// Rotor leakage that is lost at high frequency, H.
    pub skin_leakage: f64,
    /// Saliency of the stator leakage that turns with the rotor's bars.
    pub slots: f64,
    /// Bars of the rotor.
    pub bars: u32,
    /// Saliency of the stator leakage that is fixed to the stator (eccentricity, stator slots).
    pub stator_fixed: f64,
    /// Its axis, electrical degrees from phase a.
    pub stator_fixed_deg: f64,
    /// Resistance of the iron losses across the main flux, ohm; 0 is none.
    pub loss: f64,
}

impl IronSettings {
    /// Linear iron.
    pub const LINEAR: Self = Self {
        psi_n: 0.124,
        saturation: 1.0,
        exponent: 6,
        chord: true,
        teeth: 0.0,
        teeth_gap: 1.0,
        teeth_turn_deg: 0.0,
        teeth_turn_deg_per_a: 0.0,
        leakage_saturation: 0.0,
        rotor_leakage_saturation: 0.0,
        skin_ratio: 1.0,
        skin_leakage: 0.0,
        slots: 0.0,
        bars: 28,
        stator_fixed: 0.0,
        stator_fixed_deg: 0.0,
        loss: 0.0,
    };

    /// Whether every term is the gradient of the energy. Only then does the power balance hold.
    pub fn conservative(&self) -> bool {
        let on_gap = self.teeth_gap == 1.0;
        let straight = self.teeth_turn_deg == 0.0 && self.teeth_turn_deg_per_a == 0.0;
        self.teeth == 0.0 || (on_gap && straight)
    }

    /// Refuses what is outside its range.
    pub(crate) fn check(&self, m: &MachineSettings) -> Result<(), PlantError> {
        check("iron.psi_n", self.psi_n, 1e-4..=100.0, "Wb")?;
        check("iron.saturation", self.saturation, 1.0..=10.0, "")?;
        check("iron.exponent", f64::from(self.exponent), 2.0..=12.0, "")?;
        check("iron.teeth", self.teeth, -0.25..=0.25, "")?;
        check("iron.teeth_gap", self.teeth_gap, 0.0..=1.0, "")?;
        check("iron.teeth_turn_deg", self.teeth_turn_deg, -90.0..=90.0, "deg")?;
        let per_a = self.teeth_turn_deg_per_a;
        check("iron.teeth_turn_deg_per_a", per_a, -90.0..=90.0, "deg/A")?;
        check("iron.leakage_saturation", self.leakage_saturation, 0.0..=50.0, "1/A")?;
        let rotor = self.rotor_leakage_saturation;
        check("iron.rotor_leakage_saturation", rotor, 0.0..=50.0, "1/A")?;
        check("iron.skin_ratio", self.skin_ratio, 1.0..=20.0, "")?;
        // The rest of the rotor leakage stays outside the bar.
        // The bottom of the bars must not be faster than the integration.
        let least = if self.skin_ratio > 1.0 { 1e-4 * m.rr } else { 0.0 };
        check("iron.skin_leakage", self.skin_leakage, least..=0.9 * m.llr, "H")?;
        check("iron.slots", self.slots, -0.1..=0.1, "")?;
        check("iron.bars", f64::from(self.bars), 4.0..=400.0, "")?;
        check("iron.stator_fixed", self.stator_fixed, -0.1..=0.1, "")?;
        check("iron.stator_fixed_deg", self.stator_fixed_deg, -180.0..=180.0, "deg")?;
        if self.loss != 0.0 {
            check("iron.loss", self.loss, 1.0..=1e6, "ohm")?;
        }
        Ok(())
    }
}

impl Default for IronSettings {
    fn default() -> Self {
        Self::LINEAR
    }
}
