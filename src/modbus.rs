//! The field bus: a Modbus RTU slave on an RS-485 line, for PLCs, spindle controllers and scripts.
//!
//! Shapes: a [`Frame`] comes in whole, [`slave::answer`] makes the frame that goes out, and asks [`slave::Registers`] for
//! words. The console has the registers ([`crate::console`]): it turns writes into the requests that its own lines make, so
//! that settings, limits, refusals and time-out are the same on both ways.

pub mod cia402;
pub mod faults;
pub mod line;
pub mod registers;
pub mod slave;
#[cfg(test)]
mod tests;

use drive_core::settings::value::Words;

pub use line::{Baud, Format};

/// Bytes of the longest frame (Modbus over serial line V1.02, 2.5.1).
pub const LONGEST: usize = 256;

/// A frame with address and checksum.
pub type Frame = heapless::Vec<u8, LONGEST>;

/// The bus's end of the RS-485 port.
pub trait Port {
    /// Sets the rate and the format of the bytes; cheap if they are so already.
    fn set_line(&mut self, baud: Baud, format: Format);
    /// The next frame: bytes with a silence before and behind.
    fn receive(&mut self) -> Option<Frame>;
    /// Sends a frame, after the one before.
    fn send(&mut self, frame: &Frame);
}

/// A board may have no bus.
impl<P: Port> Port for Option<P> {
    fn set_line(&mut self, baud: Baud, format: Format) {
        self.iter_mut().for_each(|port| port.set_line(baud, format));
    }
    fn receive(&mut self) -> Option<Frame> {
        self.as_mut().and_then(P::receive)
    }
    fn send(&mut self, frame: &Frame) {
        self.iter_mut().for_each(|port| port.send(frame));
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
