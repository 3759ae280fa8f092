//! Pins (RM0440, section 9). An input has the level of its pull resistor.

use super::{Effect, Store, offsets};

offsets! { MODER = 0x00, OTYPER = 0x04, OSPEEDR = 0x08, PUPDR = 0x0c, IDR = 0x10, ODR = 0x14, BSRR = 0x18, AFRL = 0x20, BRR = 0x28 }

/// The function of a pin in its port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pad {
    /// Input.
    Input,
    /// Output, with this level.
    Output(bool),
    /// The pin belongs to this alternate function.
    Alternate(u32),
    /// Analog.
    Analog,
}

/// A port.
#[derive(Clone, Debug)]
pub struct Gpio(Store);

impl Gpio {
    /// Makes a port; port A is 0.
    pub fn new(port: usize) -> Self {
        let mut store = Store::of("GPIO");
        // The pins of the debug port.
        let values = match port {
            0 => [0x0c00_0000, 0xabff_ffff, 0x6400_0000],
            1 => [0x0000_00c0, 0xffff_febf, 0x0000_0100],
            _ => [0, u32::MAX, 0],
        };
        for (register, value) in [OSPEEDR, MODER, PUPDR].into_iter().zip(values) {
            store.write(register, value);
        }
        Self(store)
    }

    /// Returns the function of a pin.
    pub fn pad(&self, pin: u32) -> Pad {
        match self.0.get(MODER) >> (2 * pin) & 3 {
            0 => Pad::Input,
            1 => Pad::Output(self.0.get(ODR) >> pin & 1 != 0),
            2 => Pad::Alternate(self.0.get(AFRL + 4 * (pin / 8)) >> (4 * (pin % 8)) & 15),
            _ => Pad::Analog,
        }
    }

    /// Whether the pin's output only drives low.
    pub fn open_drain(&self, pin: u32) -> bool {
        self.0.get(OTYPER) >> pin & 1 != 0
    }

    /// Returns the level to which the port's own resistor pulls a pin. The resistor is off in analog mode.
    pub fn pull(&self, pin: u32) -> Option<bool> {
        match (self.pad(pin), self.0.get(PUPDR) >> (2 * pin) & 3) {
            (Pad::Analog, _) | (_, 0 | 3) => None,
            (_, up) => Some(up == 1),
        }
    }

    /// Returns the levels at the pins.
    fn levels(&self) -> u32 {
        let pulls = self.0.get(PUPDR);
        (0..16).fold(0, |w, n| w | u32::from(pulls >> (2 * n) & 3 == 1) << n)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        if offset == IDR { Some(self.levels()) } else { self.0.read(offset) }
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        let odr = self.0.get(ODR);
        match offset {
            BSRR => self.0.write(ODR, odr & !(value >> 16) | value & 0xffff),
            BRR => self.0.write(ODR, odr & !value),
            _ => self.0.write(offset, value),
        }
    }
}
