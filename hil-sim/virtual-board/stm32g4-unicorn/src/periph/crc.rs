//! The CRC unit (RM0440, section 16), with its reset polynomial, for words whose bits are reversed.

use super::{Effect, bits};

bits! { RESET = 0 }
/// CR: the bits of words are reversed at the input, those of the value at the output.
const REVERSED: u32 = 0xe0;
const DR: u32 = 0x00;
const CR: u32 = 0x08;

/// The unit: CR, and the value as it is read.
#[derive(Clone, Copy, Debug, Default)]
pub struct CrcUnit {
    cr: u32,
    value: u32,
}

impl CrcUnit {
    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        [(DR, self.value), (CR, self.cr)].into_iter().find(|r| r.0 == offset).map(|r| r.1)
    }

    /// Writes a register. Words in another bit order are not modelled.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        match offset {
            CR => {
                self.cr = value & !RESET;
                self.value = if value & RESET != 0 { u32::MAX } else { self.value };
            }
            DR if self.cr == REVERSED => {
                let step = |v: u32, _| v >> 1 ^ if v & 1 != 0 { 0xedb8_8320 } else { 0 };
                self.value = (0..32).fold(self.value ^ value, step);
            }
            _ => return None,
        }
        Some(Effect::None)
    }
}
