//! The check of the gates: it runs whenever anything changes on which the gates depend.

use super::bridge::{BadGates, Bridge};
use super::{PowerStage, REFERENCE};
use stm32g4_unicorn::circuit::Circuit;
use stm32g4_unicorn::periph::gpio::{Gpio, Pad};
use stm32g4_unicorn::periph::tim1::Tim1;

/// A violation, with its place and time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen {
    /// The violation.
    pub what: BadGates,
    /// Last known position of the core.
    pub at: u32,
    /// Time, ticks.
    pub time: u64,
}

/// The power stage of a chip, with the present state of its gates.
#[derive(Clone, Debug)]
pub struct GateWatch {
    /// The power stage.
    pub stage: &'static PowerStage,
    /// The present gates.
    pub bridge: Bridge,
    /// Whether the gate drivers have no supply, so that every switch is off.
    pub without_supply: bool,
    seen: Option<Seen>,
}

impl GateWatch {
    /// Makes the check for a chip whose pins are released.
    pub fn new(stage: &'static PowerStage, gpio: &[Gpio], tim1: &Tim1) -> Self {
        Self { stage, bridge: Bridge::new(stage, gpio, tim1), without_supply: false, seen: None }
    }

    /// Returns the first violation since the last call.
    pub fn take(&mut self) -> Option<Seen> {
        self.seen.take()
    }
}

impl Default for GateWatch {
    fn default() -> Self {
        Self::new(&REFERENCE, &[0, 1, 2, 3, 4, 5, 6].map(Gpio::new), &Tim1::default())
    }
}

/// Checks the gates.
impl Circuit for GateWatch {
    fn follow(&mut self, gpio: &[Gpio; 7], tim1: &Tim1, at: u32, time: u64) {
        self.bridge = Bridge::new(self.stage, gpio, tim1);
        if self.without_supply {
            self.bridge.legs = Default::default();
            return;
        }
        let mut pins = self.stage.analog_only.iter();
        let strayed = pins.find(|(port, pin)| gpio[*port].pad(*pin) != Pad::Analog);
        let strayed = strayed.map(|(port, pin)| BadGates::NotAnalog { port: *port, pin: *pin });
        if let Some(what) = strayed.or_else(|| self.bridge.check(self.stage).err()) {
            self.seen.get_or_insert(Seen { what, at, time });
        }
    }
}
