//! Resistances that rise with time.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};

/// Warming: each resistance goes to `1 + rise` times its value with one time constant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WarmingSettings {
    /// Relative rise of the stator resistance.
    pub rs: f64,
    /// Relative rise of the rotor resistance.
    pub rr: f64,
    /// Time constant, s.
    pub time_constant: f64,
}

impl Default for WarmingSettings {
    fn default() -> Self {
        Self { rs: 0.0, rr: 0.0, time_constant: 60.0 }
    }
}

impl WarmingSettings {
    /// Refuses what is outside its range.
    pub(crate) fn check(&self) -> Result<(), PlantError> {
        check("warming.rs", self.rs, -0.5..=2.0, "")?;
        check("warming.rr", self.rr, -0.5..=2.0, "")?;
        check("warming.time_constant", self.time_constant, 0.01..=1e5, "s")
    }

    /// Factors of stator and rotor resistance after `t` seconds; none without warming.
    pub(crate) fn factors(&self, t: f64) -> Option<(f64, f64)> {
        if self.rs == 0.0 && self.rr == 0.0 {
            return None;
        }
        let share = -(-t / self.time_constant).exp_m1();
        Some((1.0 + self.rs * share, 1.0 + self.rr * share))
    }
}
