//! Comparators and their reference voltages (RM0440, sections 22 and 24).
//!
//! A comparator is given its input by [`Comparators::inputs`], in codes of a 12-bit converter, and
//! compares it with the channel of the converter its INMSEL names.

use super::{Effect, Plain, Store};

const ALL: u32 = u32::MAX;
const COMP: &[Plain] = &[
    (0x00, 0, 0x80ff_ffff),
    (0x04, 0, 0x80ff_ffff),
    (0x08, 0, 0x80ff_ffff),
    (0x0c, 0, 0x80ff_ffff),
    (0x10, 0, 0x80ff_ffff),
    (0x14, 0, 0x80ff_ffff),
    (0x18, 0, 0x80ff_ffff),
];
const DAC: &[Plain] = &[
    (0x00, 0, ALL),
    (0x08, 0, 0xfff),
    (0x14, 0, 0xfff),
    (0x34, 0, ALL),
    (0x38, 0, ALL),
    (0x3c, 0, ALL),
];

/// The comparators 1 to 7.
#[derive(Clone, Debug)]
pub struct Comparators {
    store: Store,
    /// Codes at their positive inputs.
    pub inputs: [u16; 7],
    /// Codes at their negative inputs.
    pub references: [u16; 7],
}

impl Default for Comparators {
    fn default() -> Self {
        Self { store: Store::new(COMP), inputs: [0; 7], references: [0; 7] }
    }
}

impl Comparators {
    /// Its INPSEL: the pin at its positive input.
    pub fn input_of(&self, n: usize) -> u32 {
        self.store.get(4 * n as u32) >> 8 & 1
    }

    /// Its INMSEL: the source of its negative input.
    pub fn reference_of(&self, n: usize) -> u32 {
        self.store.get(4 * n as u32) >> 4 & 7
    }

    /// The output of comparator `n`, counted from 0, with its polarity.
    pub fn output(&self, n: usize) -> bool {
        let control = self.store.get(4 * n as u32);
        let on = control & 1 != 0;
        on && (self.inputs[n] > self.references[n]) != (control & 1 << 15 != 0)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let value = self.store.read(offset)?;
        Some(value | u32::from(self.output((offset / 4) as usize)) << 30)
    }

    /// Writes a register; a locked one stays as it is.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        if self.store.read(offset)? & 1 << 31 == 0 {
            self.store.write(offset, value)?;
        }
        Some(Effect::Look)
    }
}

/// Two of the digital-to-analog converters: 1 and 3.
#[derive(Clone, Debug)]
pub struct Dacs([Store; 2]);

impl Default for Dacs {
    fn default() -> Self {
        Self([Store::new(DAC), Store::new(DAC)])
    }
}

impl Dacs {
    /// The code that channel 1 or 2 of a converter puts out.
    pub fn code(&self, which: usize, channel: usize) -> u16 {
        let on = self.0[which].get(0) >> (16 * (channel - 1)) & 1 != 0;
        if on { self.0[which].get([0x08, 0x14][channel - 1]) as u16 } else { 0 }
    }

    /// Reads a register.
    pub fn read(&self, which: usize, offset: u32) -> Option<u32> {
        match offset {
            0x2c => Some(u32::from(self.code(which, 1))),
            0x30 => Some(u32::from(self.code(which, 2))),
            // Ready as soon as they are on.
            0x34 => Some(self.0[which].get(0x34) | (self.0[which].get(0) & 0x0001_0001) << 11),
            _ => self.0[which].read(offset),
        }
    }

    /// Writes a register.
    pub fn write(&mut self, which: usize, offset: u32, value: u32) -> Option<Effect> {
        self.0[which].write(offset, value).map(|_| Effect::Look)
    }
}
