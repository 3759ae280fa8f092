//! Named saturation models, which fix where the saliency of a motor comes from.
//!
//! Values that measurements leave open were chosen here once and stay fixed. They are never changed to tune a drive.

use super::IronSettings;

/// A saturation model: its name and its magnetic settings. Settings per ampere are for a nominal magnetising current of
/// 0.7 A on a motor with the rated current of Table 5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Family {
    /// Name.
    pub name: &'static str,
    /// Source of the saliency.
    pub about: &'static str,
    /// Magnetic settings.
    pub iron: IronSettings,
}

/// Relative decrease of the stator leakage inductance, 1/A: a current-fixed saliency of about 3.6 % per ampere.
const LEAKAGE: f64 = 0.15;

const LINEAR: IronSettings = IronSettings::LINEAR;
const R: IronSettings =
    IronSettings { teeth: -0.035, teeth_gap: 0.0, leakage_saturation: LEAKAGE, ..LINEAR };
const G: IronSettings = IronSettings { teeth_gap: 1.0, ..R };
const M6: IronSettings = IronSettings { saturation: 1.3, exponent: 6, ..LINEAR };
const M4: IronSettings = IronSettings { exponent: 4, ..M6 };
/// Peak of the rated current of Table 5, A.
const RATED: f64 = 2.56 * std::f64::consts::SQRT_2;
/// Relative decrease of both leakage inductances per rated current. As measured at a start, each falls to half between
/// one and five times the rated current: 2 (1 + sqrt(1 + 4 k)) = 1 + sqrt(1 + 20 k) at k = 6. At the rated current it
/// is a third of the unsaturated inductance.
const PER_RATED: f64 = 6.0;
const RL: IronSettings = IronSettings {
    nominal_a: RATED,
    leakage_saturation: PER_RATED / RATED,
    rotor_leakage_saturation: PER_RATED / RATED,
    ..R
};
const F: IronSettings = IronSettings {
    saturation: 1.1,
    exponent: 6,
    leakage_saturation: 0.05,
    rotor_leakage_saturation: 0.10,
    skin_ratio: 3.5,
    skin_leakage: 0.005,
    ..G
};

/// All saturation models.
#[rustfmt::skip] // one a line
pub const FAMILIES: [Family; 12] = [
    Family { name: "linear", about: "no saturation: the textbook machine, no saliency", iron: LINEAR },
    Family { name: "r", about: "teeth -3.5 %, fixed to the rotor flux (not a gradient); stator leakage saturates", iron: R },
    Family { name: "r5", about: "as r, -5 %", iron: IronSettings { teeth: -0.05, ..R } },
    Family { name: "g", about: "teeth -3.5 %, fixed to the air-gap flux; stator leakage saturates", iron: G },
    Family { name: "g7", about: "as g, -7 %", iron: IronSettings { teeth: -0.07, ..G } },
    Family { name: "rl", about: "as r; both leakages saturate as measured at a start, to half at five times the rated current", iron: RL },
    Family { name: "gl", about: "as rl, the teeth fixed to the air-gap flux", iron: IronSettings { teeth_gap: 1.0, ..RL } },
    Family { name: "m4", about: "main flux saturated by 1.3 at nominal flux, n = 4", iron: M4 },
    Family { name: "m6", about: "main flux saturated by 1.3 at nominal flux, n = 6", iron: M6 },
    Family { name: "m4b", about: "as m4; stator leakage saturates too", iron: IronSettings { leakage_saturation: LEAKAGE, ..M4 } },
    Family { name: "m6b", about: "as m6; stator leakage saturates too", iron: IronSettings { leakage_saturation: LEAKAGE, ..M6 } },
    Family { name: "f", about: "teeth on the air-gap flux, main flux saturated by 1.1, n = 6, both leakages saturate, skin effect", iron: F },
];
