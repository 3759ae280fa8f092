//! Models of the peripherals, one file each, according to RM0440. `None` is a register that is not modelled.

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

use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

/// Time of an event that never comes, ticks.
pub const NEVER: u64 = u64::MAX;

/// Cause of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power-on.
    Power,
    /// The reset pin.
    Pin,
    /// A request of the program.
    Software,
    /// The independent watchdog.
    Watchdog,
    /// The window watchdog.
    Window,
}

impl fmt::Display for Reset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let causes = ["power-on", "reset pin", "software", "watchdog", "window watchdog"];
        write!(f, "reset by {}", causes[*self as usize])
    }
}

/// The effect of a write beyond its register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// No further effect.
    None,
    /// Requests or events may have changed.
    Look,
    /// A reset is requested.
    Reset,
}

/// Defines offsets of registers.
macro_rules! offsets {
    ($($name:ident = $offset:literal),*) => { $(pub(crate) const $name: u32 = $offset;)* };
}
use offsets;

/// Defines bits of a register, each by its number.
macro_rules! bits {
    ($($seen:vis $name:ident = $number:literal),*) => { $($seen const $name: u32 = 1 << $number;)* };
}
pub(crate) use bits;

/// A register that stores its value: offset, value, and the writable bits.
type Register = (u32, u32, u32);

/// All registers after a reset, by peripheral and name.
static AT_RESET: LazyLock<BTreeMap<String, BTreeMap<String, Register>>> = LazyLock::new(|| {
    toml::from_str(include_str!("periph/registers.toml")).expect("the table of registers")
});

/// Returns the addresses of a peripheral's registers that keep their value, and their writable bits.
pub(crate) fn kept(peripheral: &str, base: u32) -> impl Iterator<Item = (u32, u32)> {
    let registers = AT_RESET[peripheral].values().filter(|register| register.2 != 0);
    registers.map(move |register| (base + register.0, register.2))
}

/// Registers without behaviour.
#[derive(Clone, Debug)]
pub struct Store(Vec<Register>);

impl Store {
    /// Returns the registers of a peripheral of `periph/registers.toml` as after reset.
    pub fn of(peripheral: &str) -> Self {
        let mut registers: Vec<_> = AT_RESET[peripheral].values().copied().collect();
        registers.sort_unstable();
        Self(registers)
    }

    fn place(&self, offset: u32) -> Option<usize> {
        self.0.binary_search_by_key(&offset, |register| register.0).ok()
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        self.place(offset).map(|place| self.0[place].1)
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        let place = self.place(offset)?;
        let (_, kept, mask) = &mut self.0[place];
        *kept = *kept & !*mask | value & *mask;
        Some(Effect::None)
    }

    /// Returns the value of a register, or 0.
    pub fn get(&self, offset: u32) -> u32 {
        self.read(offset).unwrap_or(0)
    }
}
