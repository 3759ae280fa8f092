//! Models of the peripherals, one file each, after RM0440. `None` is a register that is not modelled.

pub mod adc;
pub mod analog;
pub mod crc;
pub mod dac;
pub mod encoder;
pub mod flash;
pub mod gpio;
pub mod iwdg;
pub mod plain;
pub mod pwr;
pub mod rcc;
pub mod tim1;
pub mod tim8;
pub mod time_base;
pub mod uart;
pub mod wwdg;

use std::fmt;

/// Time of an event that does not come, ticks.
pub const NEVER: u64 = u64::MAX;

/// Cause of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power-on.
    Power,
    /// The reset pin.
    Pin,
    /// A request of the firmware.
    Software,
    /// The independent watchdog.
    Watchdog,
    /// The window watchdog.
    Window,
}

/// As the firmware's log names it.
impl fmt::Display for Reset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let causes = ["power-on", "reset pin", "software", "watchdog", "window watchdog"];
        write!(f, "reset by {}", causes[*self as usize])
    }
}

/// The effect of a write beyond its register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing.
    None,
    /// Requests or events may have changed.
    Look,
    /// A reset is asked for.
    Reset,
}

/// A register without behaviour: offset, value after reset, bits that can be written.
pub type Plain = (u32, u32, u32);

/// The registers of a peripheral as `KNOWN`, a row each: name (`_`: of no meaning to the model), offset, value after reset,
/// bits that can be written. The names become constants.
macro_rules! registers {
    ($($name:tt = $offset:expr, $reset:expr, $mask:expr;)*) => {
        $(pub(crate) const $name: u32 = $offset;)*
        const KNOWN: &[$crate::periph::Plain] = &[$(($offset, $reset, $mask)),*];
    };
}
use registers;

/// Bits of a register, each by its number.
macro_rules! bits {
    ($($seen:vis $name:ident = $number:literal),*) => { $($seen const $name: u32 = 1 << $number;)* };
}
use bits;

/// Registers without behaviour.
#[derive(Clone, Debug)]
pub struct Store {
    known: &'static [Plain],
    values: Vec<u32>,
}

impl Store {
    /// These registers as after reset.
    pub fn new(known: &'static [Plain]) -> Self {
        Self { known, values: known.iter().map(|register| register.1).collect() }
    }

    fn place(&self, offset: u32) -> Option<usize> {
        self.known.iter().position(|register| register.0 == offset)
    }

    /// Reads one.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.place(offset).map(|place| self.values[place])
    }

    /// Writes one.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        let place = self.place(offset)?;
        let mask = self.known[place].2;
        self.values[place] = self.values[place] & !mask | value & mask;
        Some(Effect::None)
    }

    /// Its value, or 0.
    pub fn get(&self, offset: u32) -> u32 {
        self.read(offset).unwrap_or(0)
    }
}
