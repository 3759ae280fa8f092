//! Frames of the drive's signals on the serial port, beside the lines of its console.
//!
//! On the wire a frame is `0x00`, its contents under COBS, `0x00`. The contents are little-endian:
//!
//! | bytes | type | content |
//! |---|---|---|
//! | 2 | `u16` | sequence number: one more for each sample that was due, dropped or not; wraps |
//! | 4 | `u32` | control period of the sample, 1/6000 s each, from the start of the firmware; wraps |
//! | 4 each | `f32` | one to [`MOST_SIGNALS`] values, in the units that the names of the signals end with |
//! | 2 | `u16` | CRC-16/IBM-3740 over all bytes before it |
//!
//! The text of the console never contains `0x00`. A receiver separates text and frames by [`Splitter`]: outside a frame all bytes but
//! `0x00` are text; a `0x00` begins a frame, which the next `0x00` ends. If the bytes between two `0x00` are not a whole frame, they are
//! discarded as damaged, and the second `0x00` begins the next frame. So a receiver that begins to listen in the middle of a frame, or
//! has lost a `0x00`, is in step again within two frames.
//!
//! The feature `client` adds a client of the console, which needs memory on the heap.
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(feature = "client")]
extern crate alloc;

#[cfg(feature = "client")]
pub mod client;
mod frame;
mod splitter;

pub use frame::{Damage, Frame, LONGEST, MOST_SIGNALS, wire_bytes};
pub use splitter::{Piece, Splitter};
