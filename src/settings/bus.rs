//! The settings of the field bus, and what the USART makes of rate and format.

use drive_settings::value::Words;

use crate::board::CLOCK_HZ;

/// Bits per second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)] // the names say it
pub enum Baud {
    B4800,
    B9600,
    B19200,
    B38400,
    B57600,
    B115200,
}

const RATES: [(Baud, u32); 6] = [
    (Baud::B4800, 4800),
    (Baud::B9600, 9600),
    (Baud::B19200, 19_200),
    (Baud::B38400, 38_400),
    (Baud::B57600, 57_600),
    (Baud::B115200, 115_200),
];

impl Words for Baud {
    const WORDS: &'static [&'static str] = &["4800", "9600", "19200", "38400", "57600", "115200"];
    fn place(self) -> usize {
        self as usize
    }
    fn at(place: usize) -> Self {
        RATES.get(place).map_or(Self::B4800, |rate| rate.0)
    }
}

/// Parity and stop bits beside eight data bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// No parity, one stop bit.
    None,
    /// Even parity, one stop bit.
    Even,
    /// No parity, two stop bits: as long as with parity, as the specification asks for.
    TwoStops,
}

impl Words for Format {
    const WORDS: &'static [&'static str] = &["8n1", "8e1", "8n2"];
    fn place(self) -> usize {
        self as usize
    }
    fn at(place: usize) -> Self {
        [Self::None, Self::Even, Self::TwoStops].get(place).copied().unwrap_or(Self::None)
    }
}

/// Silence that ends a frame above 19 200 bit/s, us (Modbus over serial line V1.02, 2.5.1.1). Below, 3.5 characters.
const SILENCE_US: u32 = 1750;

impl Baud {
    /// Bits per second.
    pub fn bits_per_s(self) -> u32 {
        RATES[self.place()].1
    }

    /// Ticks of [`CLOCK_HZ`] per bit, rounded: the BRR register (RM0440, USART baud rate generation; 16 to 65535).
    pub fn divider(self) -> u16 {
        // All rates give values in the range; see the tests.
        ((CLOCK_HZ + self.bits_per_s() / 2) / self.bits_per_s()) as u16
    }

    /// Bits of silence that end a frame, rounded up: the RTO field.
    pub fn silence_bits(self, format: Format) -> u32 {
        if self.bits_per_s() > 19_200 {
            (self.bits_per_s() * SILENCE_US).div_ceil(1_000_000)
        } else {
            (7 * format.bits()).div_ceil(2)
        }
    }
}

impl Format {
    /// Bits of a byte on the line, with start, parity and stop bits.
    pub fn bits(self) -> u32 {
        if self == Self::None { 10 } else { 11 }
    }
}

/// Who starts the drive and gives it references. Anybody may stop it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Commander {
    /// The console.
    #[default]
    Console,
    /// The bus.
    Bus,
}

impl Words for Commander {
    const WORDS: &'static [&'static str] = &["console", "bus"];
    fn place(self) -> usize {
        self as usize
    }
    fn at(place: usize) -> Self {
        if place == 1 { Self::Bus } else { Self::Console }
    }
}

/// Settings of the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Address of the drive, 1 to 247.
    pub address: u32,
    /// Bits per second.
    pub baud: Baud,
    /// Format of a byte.
    pub format: Format,
    /// Who commands.
    pub commander: Commander,
}

impl Default for Settings {
    fn default() -> Self {
        // Rate and parity that the specification recommends (Modbus over serial line V1.02, 2.4.2).
        let (baud, format) = (Baud::B19200, Format::Even);
        Self { address: 1, baud, format, commander: Commander::Console }
    }
}
