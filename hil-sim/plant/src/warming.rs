//! Resistances that rise with time.

use crate::error::PlantError;
use crate::machine::MachineSettings;
use crate::settings::settings;

settings! {
    /// Warming: each resistance rises to `1 + rise` times its value with a common time constant.
    WarmingSettings "warming." {
        /// Relative rise of the stator resistance.
        rs: f64 = 0.0, -0.5..=2.0, "";
        /// Relative rise of the rotor resistance.
        rr: f64 = 0.0, -0.5..=2.0, "";
        /// Time constant, s.
        time_constant: f64 = 60.0, 0.01..=1e5, "s";
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

/// Resistances as functions of time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Warming {
    law: WarmingSettings,
    cold: (f64, f64),
}

impl Warming {
    /// Starts from the cold resistances; none if the resistances are constant.
    pub(crate) fn new(
        law: &WarmingSettings,
        machine: &MachineSettings,
    ) -> Result<Option<Self>, PlantError> {
        law.check()?;
        Ok(law.acts().then_some(Self { law: *law, cold: (machine.rs, machine.rr) }))
    }

    /// Resistances of stator and rotor after this number of periods, ohm; none if they need no change.
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
