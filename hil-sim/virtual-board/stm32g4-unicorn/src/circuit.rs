//! The circuit at the pins of the chip.

use crate::periph::{gpio::Gpio, tim1::Tim1};

/// Supply of the chip and reference of its ADCs, V.
pub const SUPPLY_V: f64 = 3.3;
/// The chip's own pull resistors, ohm (datasheet: 25 to 55 kOhm).
pub const PULL_OHM: f64 = 40e3;

/// A circuit that follows the digital pins of the chip. Its inputs to the chip are fields and methods of
/// [`Chip`](crate::Chip).
///
/// ```
/// use stm32g4_unicorn::periph::{Reset, gpio::Gpio, gpio::Pad, tim1::Tim1};
/// use stm32g4_unicorn::{Chip, Circuit};
///
/// /// A light-emitting diode at PA5.
/// #[derive(Default)]
/// struct Led {
///     is_lit: bool,
/// }
///
/// impl Circuit for Led {
///     fn follow(&mut self, ports: &[Gpio; 7], _: &Tim1, _: u32, _: u64) {
///         self.is_lit = ports[0].pad(5) == Pad::Output(true);
///     }
/// }
///
/// let mut chip = Chip::<Led>::default();
/// // The clock of the port, then MODER and BSRR.
/// for (address, value) in [(0x4002_104c, 1), (0x4800_0000, 1 << 10), (0x4800_0018, 1 << 5)] {
///     assert!(!chip.circuit.is_lit);
///     chip.write(address, 4, value);
///     chip.now += 100;
/// }
/// assert!(chip.circuit.is_lit);
/// chip.reset(Reset::Pin);
/// assert!(!chip.circuit.is_lit);
/// ```
pub trait Circuit: Default + 'static {
    /// Follows the ports A to G and the outputs of TIM1. The chip calls it after each write that may have changed them
    /// and at each top of the counter, with the last known position of the core `at` and the time `now`, ticks.
    fn follow(&mut self, ports: &[Gpio; 7], tim1: &Tim1, at: u32, now: u64);
}

/// Nothing is connected.
impl Circuit for () {
    fn follow(&mut self, _: &[Gpio; 7], _: &Tim1, _: u32, _: u64) {}
}

/// The circuit at an analog pin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Source {
    /// A divider with this resistance, seen from the pin, and a capacitor to ground.
    Divider {
        /// Resistance, ohm.
        ohm: f64,
        /// Capacitance, F.
        farad: f64,
    },
    /// An amplifier or an isolated sensor drives the pin: a pull resistor of the chip does not change its level.
    #[default]
    Driven,
}

/// A resistor to a voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Voltage, V.
    pub volts: f64,
    /// Resistance, ohm.
    pub ohm: f64,
}

/// Returns the level that resistors set: low below the first threshold, V, high above the second, none in between.
pub fn level(pulls: impl Iterator<Item = Pull> + Clone, thresholds: (f64, f64)) -> Option<bool> {
    let conductance: f64 = pulls.clone().map(|pull| 1.0 / pull.ohm).sum();
    let volts = pulls.map(|pull| pull.volts / pull.ohm).sum::<f64>() / conductance;
    // Without any resistor the voltage is not a number, which is neither level.
    match thresholds {
        (low, _) if volts < low => Some(false),
        (_, high) if volts > high => Some(true),
        _ => None,
    }
}
