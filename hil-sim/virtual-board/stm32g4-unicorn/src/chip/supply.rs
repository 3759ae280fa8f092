//! The supply: monitor, brown-out reset, and the break of TIM1 that follows the monitor.

use super::{Chip, Circuit};
use crate::periph::{Reset, plain};
use crate::rules::Rule;

impl<C: Circuit> Chip<C> {
    /// Sets the supply of the chip, V. Below the level of the option bytes the chip is held in reset.
    pub fn set_supply(&mut self, volts: f64) {
        let was = self.browned_out();
        self.pwr.supply_v = volts;
        if !was && self.browned_out() {
            self.reset = Some(Reset::Power);
        }
        self.attention = true;
        self.monitor_supply();
    }

    /// Whether the supply holds the chip in reset.
    pub fn browned_out(&self) -> bool {
        self.pwr.supply_v < self.flash.brown_out_v()
    }

    /// Whether SYSCFG has locked the supply monitor.
    pub(super) fn monitor_is_locked(&self) -> bool {
        self.syscfg.get(plain::CFGR2) & plain::PVDL != 0
    }

    /// Makes the break of TIM1 follow the monitor.
    pub(super) fn monitor_supply(&mut self) {
        if !self.monitor_is_locked() {
            return;
        }
        let on = self.pwr.monitors();
        self.rules.require(on, Rule::SupplyMonitor, || {
            "SYSCFG_CFGR2.PVDL is set while PWR_CR2.PVDE is off".into()
        });
        if self.pwr.too_low() {
            self.system_break();
            self.follow_pins();
        }
    }
}
