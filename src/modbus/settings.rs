//! The settings of the field bus, and the USART's values for rate and format.

use drive_core::Stop;
use drive_settings::value::Words;
use drive_settings::words;

use crate::board::CLOCK_HZ;
use crate::settings::own::settings;

words! {
    /// Bits per second.
    #[allow(missing_docs)] // the names say it
    pub enum Baud {
        B4800 = "4800",
        B9600 = "9600",
        B19200 = "19200",
        B38400 = "38400",
        B57600 = "57600",
        B115200 = "115200",
    }
}

words! {
    /// Parity and stop bits beside eight data bits.
    pub enum Format {
        /// No parity, one stop bit.
        None = "8n1",
        /// Even parity, one stop bit.
        Even = "8e1",
        /// No parity, two stop bits: as long as a byte with parity, as the specification requires.
        TwoStops = "8n2",
    }
}

/// Silence that ends a frame above 19 200 bit/s, us (Modbus over serial line V1.02, 2.5.1.1). Below, 3.5 characters.
const SILENCE_US: u32 = 1750;

impl Baud {
    /// Bits per second.
    pub fn bits_per_s(self) -> u32 {
        [4800, 9600, 19_200, 38_400, 57_600, 115_200][self as usize]
    }

    /// Ticks of [`CLOCK_HZ`] per bit, rounded: the BRR register (RM0440, USART baud rate generation; 16 to 65535).
    pub fn divider(self) -> u16 {
        // All rates give values in the range, see the tests. The compiler cannot tell that none is zero.
        let rate = self.bits_per_s().max(1);
        ((CLOCK_HZ + rate / 2) / rate) as u16
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

words! {
    /// The requests that count as signs of life of the commanding master: valid ones to the address of the drive alone.
    #[derive(Default)]
    pub enum Alive {
        /// Requests that write command, frequency or control word.
        #[default]
        Writes = "writes",
        /// All requests, for masters that write once and then only read.
        Any = "any",
    }
}

words! {
    /// The stop by the command register.
    #[derive(Default)]
    pub enum StopBy {
        /// The speed falls by `speed.ramp_rpm_per_s`, as masters expect that wait for standstill.
        #[default]
        Ramp = "ramp",
        /// The outputs go off, and the shaft coasts.
        Coast = "coast",
    }
}

words! {
    /// Quick stop option code of CiA 402 (object 0x605A).
    #[derive(Default)]
    pub enum QuickStop {
        /// The outputs go off, and the shaft coasts.
        Off = "0",
        /// By `speed.ramp_rpm_per_s`.
        Ramp = "1",
        /// By `speed.quick_rpm_per_s`.
        #[default]
        Quick = "2",
        /// As 1, and the state stays *quick stop active*.
        RampStays = "5",
        /// As 2, and the state stays *quick stop active*.
        QuickStays = "6",
    }
}

impl QuickStop {
    /// The stop of the drive, and whether the state stays *quick stop active* at standstill.
    pub fn reaction(self) -> (Stop, bool) {
        match self {
            Self::Off => (Stop::Now, false),
            Self::Ramp => (Stop::Ramp, false),
            Self::Quick => (Stop::Quick, false),
            Self::RampStays => (Stop::Ramp, true),
            Self::QuickStays => (Stop::Quick, true),
        }
    }
}

// Rate and parity are those that the specification recommends (Modbus over serial line V1.02, 2.4.2).
settings! { [modules.bus]
    105: whole(), "bus.address", address: u32 = 1, "address of the drive on the bus".from_to(1.0, 247.0);
    106: word("bit/s"), "bus.baud", baud: Baud = Baud::B19200, "rate of the bus";
    107: word(), "bus.parity", format: Format = Format::Even, "data bits, parity and stop bits of the bus";
    131: word(), "bus.alive", alive: Alive = Alive::Writes, "requests that keep the master alive: commands, or any valid one".guarded(Guard::Lower);
    136: word(), "bus.stop", stop: StopBy = StopBy::Ramp, "stop by 1 in the command register: by the ramp of the speed, or the shaft coasts";
    137: word(), "bus.quick_stop", quick_stop: QuickStop = QuickStop::Quick, "quick stop of CiA 402: 0 coast, 1 ramp, 2 quick ramp; 5, 6 as 1, 2, and its state stays";
    138: number("s"), "bus.delay_s", delay_s: f32 = 0.0, "time before a request is carried out and answered, for masters that switch their driver off late".from_to(0.0, 0.02);
    139: number("%"), "bus.reached_pct", reached_pct: f32 = 1.0, "deviation of the speed that counts as reached, of `speed.limit_rpm`".from_to(0.1, 20.0);
    140: number("%"), "bus.standstill_pct", standstill_pct: f32 = 0.5, "speed that counts as standstill, of `speed.limit_rpm`".from_to(0.05, 5.0);
    141: number("s"), "bus.steady_s", steady_s: f32 = 0.1, "time for which the speed must be reached, or the shaft at standstill, until it is told".from_to(0.0, 10.0);
}

impl Settings {
    /// The address in a frame.
    pub fn own(&self) -> u8 {
        // Always 1 to 247.
        self.address as u8
    }
}
