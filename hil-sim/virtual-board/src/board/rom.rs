//! ST's boot loader in the system memory, which starts instead of the image: the pins as it drives them.

use super::Board;
use crate::periph::Reset;

/// Bits of the option bytes (RM0440, FLASH_OPTR).
pub const N_SWBOOT0: u32 = 1 << 26;
/// The same.
pub const N_BOOT0: u32 = 1 << 27;

/// Registers of a port.
const MODER: u32 = 0x00;
const PUPDR: u32 = 0x0c;
const BSRR: u32 = 0x18;

/// The loader's hold of a pin, as its fields of MODER and PUPDR: driven, idle at a high level; an input that the chip pulls up;
/// one that it pulls down.
type Held = (u32, u32);
const HIGH: Held = (1, 1);
const UP: Held = (0, 1);
const DOWN: Held = (0, 2);

/// Port, 0 is A, and number of the pins of its serial ports, SPI and I2C that a power stage has (AN2606, table of the
/// configuration of STM32G47x in system memory boot).
const PINS: [(usize, u32, Held); 8] = [
    (0, 6, HIGH),
    (0, 7, DOWN),
    (0, 8, UP),
    (0, 9, HIGH),
    (0, 10, UP),
    (1, 14, HIGH),
    (2, 6, UP),
    (2, 8, UP),
];

/// Whether these option bytes and this level at PB8 start the loader (RM0440, boot configuration).
fn starts(option_bytes: u32, boot_pin: bool) -> bool {
    if option_bytes & N_SWBOOT0 != 0 { boot_pin } else { option_bytes & N_BOOT0 == 0 }
}

impl Board {
    /// Resets the chip with this level at PB8; whether ST's loader runs since then, instead of the image, until the next reset.
    pub fn reset_with_boot_pin(&mut self, high: bool) -> bool {
        self.reset(Reset::Pin);
        let chip = self.chip();
        if !starts(chip.flash.options, high) {
            return false;
        }
        for (port, pin, (mode, pull)) in PINS {
            let gpio = &mut chip.gpio[port];
            gpio.write(BSRR, 1 << pin);
            for (register, field) in [(PUPDR, pull), (MODER, mode)] {
                let others = gpio.read(register).unwrap_or(0) & !(3 << (2 * pin));
                gpio.write(register, others | field << (2 * pin));
            }
        }
        chip.look_at_gates();
        self.hang();
        true
    }
}
