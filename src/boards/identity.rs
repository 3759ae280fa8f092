//! The record in the first page of an image that names its board. `cargo sim update` and `cargo xtask flash` read it before they write an
//! image.

use super::pin::Pin;
use super::{Board, Level};
use crate::hash;

/// Marks the record in the image.
pub const MAGIC: [u8; 8] = *b"idboard1";
/// Bytes of a name, filled up with zeros.
pub const NAME: usize = 32;

/// The record, as it lies in the image.
#[repr(C)]
pub struct Identity {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// Name of the board.
    pub name: [u8; NAME],
    /// Levels that switch a high side and a low side on: bits 0 and 1, 1 for a high level.
    pub on_at: u32,
    /// Hash of the gate pins and the fault input, in their order.
    pub pins: u32,
}

impl Identity {
    /// The identity of a board.
    pub const fn of(board: &Board) -> Self {
        let (bytes, mut name) = (board.name.as_bytes(), [0; NAME]);
        assert!(bytes.len() < NAME, "the board's name is too long");
        name.split_at_mut(bytes.len()).0.copy_from_slice(bytes);
        let high = matches!(board.high.on_at.value, Level::High) as u32;
        let low = matches!(board.low.on_at.value, Level::High) as u32;
        let [a, b, c] = board.high.pins;
        let [d, e, f] = board.low.pins;
        let (pins, mut hash, mut i) = ([a, b, c, d, e, f, board.fault.pin], hash::BASIS, 0);
        while i < pins.len() {
            let Pin { port, number } = pins[i];
            hash = hash::add(hash, (port as u32) << 8 | number as u32);
            i += 1;
        }
        Self { magic: MAGIC, name, on_at: high | low << 1, pins: hash }
    }
}
