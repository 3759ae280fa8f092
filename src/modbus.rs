//! The field bus: a Modbus RTU slave on an RS-485 line, for PLCs, spindle controllers and scripts.
//!
//! Data flow: a whole [`Frame`] comes in, [`slave::answer`] makes the frame that goes out, and asks [`slave::Registers`] for words.
//! [`bus::Bus`] has the registers: it turns writes into requests to the command arbiter ([`crate::desk`]).

pub mod bus;
pub mod cia402;
pub mod faults;
pub mod float;
#[cfg(target_os = "none")]
mod port;
mod refusals;
pub mod registers;
pub mod settings;
pub mod slave;
#[cfg(test)]
pub(crate) mod tests;

pub use bus::Bus;
#[cfg(target_os = "none")]
pub use port::Usart;
pub use settings::{ROWS, Settings};
use slave::Written;

/// Bytes of the longest frame (Modbus over serial line V1.02, 2.5.1).
pub const LONGEST: usize = 256;

/// A frame with address and checksum.
pub type Frame = heapless::Vec<u8, LONGEST>;

/// The bus's end of the RS-485 port. Without a line its functions do nothing.
pub trait Port {
    /// Sets rate and format of the bytes, and the address that the port answers for; cheap if they have not changed.
    fn set_line(&mut self, _: &Settings) {}
    /// The next frame, if there is one and it `is_due`: bytes between two silent intervals.
    fn receive(&mut self, _is_due: impl FnOnce() -> bool) -> Option<Frame> {
        None
    }
    /// Sends a frame, after the previous one.
    fn send(&mut self, _: &Frame) {}
    /// While the slave is busy, the port itself answers its requests with [`slave::busy`].
    fn set_busy(&mut self, _: bool) {}
    /// A stop that came while the slave was busy, or had not yet taken the previous frame. It is acknowledged, and still to be carried
    /// out.
    fn take_stop(&mut self) -> Option<Written> {
        None
    }
}
