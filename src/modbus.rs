//! The field bus: a Modbus RTU slave on an RS-485 line, for PLCs, spindle controllers and scripts.
//!
//! Shapes: a [`Frame`] comes in whole, [`slave::answer`] makes the frame that goes out, and asks [`slave::Registers`] for
//! words. The console has the registers ([`crate::console`]): it turns writes into the requests that its own lines make, so
//! that settings, limits, refusals and time-out are the same on both ways.

pub mod cia402;
pub mod faults;
pub mod float;
pub mod registers;
pub mod slave;
#[cfg(test)]
mod tests;

use crate::settings::bus::{Baud, Format};

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
