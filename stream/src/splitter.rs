//! Separation of text and frames on one wire.

use heapless::Vec;

use crate::frame::{Frame, LONGEST};

/// The piece that a byte completes.
#[derive(Clone, Debug, PartialEq)]
pub enum Piece {
    /// Nothing yet.
    Nothing,
    /// A byte of text: the byte itself.
    Text(u8),
    /// A frame.
    Frame(Frame),
    /// Bytes that were discarded: neither a whole frame nor certainly text.
    Damaged,
}

/// Separates text and frames; see the head of the crate.
#[derive(Clone, Debug, Default)]
pub struct Splitter {
    /// The bytes of a frame so far; `None` in text.
    block: Option<Vec<u8, LONGEST>>,
}

impl Splitter {
    /// A splitter that expects text.
    pub const fn new() -> Self {
        Self { block: None }
    }

    /// Takes the next byte.
    pub fn push(&mut self, byte: u8) -> Piece {
        match (&mut self.block, byte) {
            (None, 0) => {
                self.block = Some(Vec::new());
                Piece::Nothing
            }
            (None, byte) => Piece::Text(byte),
            // The end of one frame and the beginning of the next, or a beginning after a lost end.
            (Some(block), 0) if block.is_empty() => Piece::Nothing,
            (Some(block), 0) => match Frame::read(block) {
                Ok(frame) => {
                    self.block = None;
                    Piece::Frame(frame)
                }
                Err(_) => {
                    block.clear();
                    Piece::Damaged
                }
            },
            (Some(block), byte) => match block.push(byte) {
                Ok(()) => Piece::Nothing,
                // Too long for a frame: text after a 0x00 that ended a frame.
                Err(_) => {
                    self.block = None;
                    Piece::Damaged
                }
            },
        }
    }
}
