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

/// The loader's hold of a pin.
enum Held {
    /// Driven, idle at a high level.
    High,
    /// An input that the chip pulls up.
    Up,
    /// An input that the chip pulls down.
    Down,
}

/// Port, 0 is A, and number of the pins of its serial ports, SPI and I2C that a power stage has (AN2606, table of the
/// configuration of STM32G47x in system memory boot).
const PINS: [(usize, u32, Held); 8] = [
    (0, 6, Held::High),
    (0, 7, Held::Down),
    (0, 8, Held::Up),
    (0, 9, Held::High),
    (0, 10, Held::Up),
    (1, 14, Held::High),
    (2, 6, Held::Up),
    (2, 8, Held::Up),
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
        for (port, pin, held) in PINS {
            let gpio = &mut chip.gpio[port];
            let (mode, pull) = match held {
                Held::High => (1, 1),
                Held::Up => (0, 1),
                Held::Down => (0, 2),
            };
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
