//! Resistances that rise with time.

use serde::{Deserialize, Serialize};

use crate::error::{PlantError, check};
use crate::machine::MachineSettings;

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
    /// Whether anything warms up.
    pub(crate) fn acts(&self) -> bool {
        self.rs != 0.0 || self.rr != 0.0
    }
}

/// Periods between two changes of the resistances.
const PERIODS: u64 = 64;

/// Resistances that follow time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Warming {
    law: WarmingSettings,
    cold: (f64, f64),
}

impl Warming {
    /// Of the machine with these cold resistances; none where they are constant.
    pub(crate) fn new(
        law: &WarmingSettings,
        machine: &MachineSettings,
    ) -> Result<Option<Self>, PlantError> {
        check("warming.rs", law.rs, -0.5..=2.0, "")?;
        check("warming.rr", law.rr, -0.5..=2.0, "")?;
        check("warming.time_constant", law.time_constant, 0.01..=1e5, "s")?;
        Ok(law.acts().then_some(Self { law: *law, cold: (machine.rs, machine.rr) }))
    }

    /// Resistances of stator and rotor after so many periods, ohm, where they are to be changed.
    pub(crate) fn resistances(&self, periods: u64, period_s: f64) -> Option<(f64, f64)> {
        if !periods.is_multiple_of(PERIODS) {
            return None;
        }
        let share = -(-(periods as f64) * period_s / self.law.time_constant).exp_m1();
        let warm = |cold: f64, rise: f64| cold * (1.0 + rise * share);
        let (rs, rr) = self.cold;
        Some((warm(rs, self.law.rs), warm(rr, self.law.rr)))
    }
}
