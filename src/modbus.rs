//! The field bus: a Modbus RTU slave on an RS-485 line, for PLCs, spindle controllers and scripts.
//!
//! Shapes: a [`Frame`] comes in whole, [`slave::answer`] makes the frame that goes out, and asks [`slave::Registers`] for
//! words. [`bus::Bus`] has the registers: it turns writes into orders to the desk ([`crate::desk`]).

pub mod bus;
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
    /// While a slave has this address the port itself answers its requests with [`slave::busy`], until `None`.
    fn set_busy(&mut self, own: Option<u8>);
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
    fn set_busy(&mut self, own: Option<u8>) {
        self.iter_mut().for_each(|port| port.set_busy(own));
    }
}
