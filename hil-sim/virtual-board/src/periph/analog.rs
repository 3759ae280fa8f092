//! Comparators (RM0440, section 24).
//!
//! A comparator gets its input and its reference as counts of a 12-bit ADC. Its output follows after its delay, with
//! its hysteresis below the reference.

use super::{Effect, NEVER, bits};

/// Writable bits.
const MASK: u32 = 0x80ff_8171;
bits! { EN = 0, POL = 15, VALUE = 30, LOCK = 31 }
/// Delay from an input beyond the reference to the output, ticks: 31 ns (datasheet, tD, 50 mV overdrive).
const DELAY: u64 = 5;
/// Time from the enable bit to a valid output, ticks: 5 us (datasheet, tSTART).
const START: u64 = 5 * 170;
/// A step of the hysteresis, 10 mV, as counts at a reference of 3.3 V.
const HYSTERESIS: u16 = 12;

/// The comparators 1 to 7.
#[derive(Clone, Debug, Default)]
pub struct Comparators {
    control: [u32; 7],
    /// ADC counts at their positive inputs.
    pub inputs: [u16; 7],
    /// Whether the output of the first comparator stays low.
    pub stuck_low: bool,
    /// ADC counts at their negative inputs.
    pub references: [u16; 7],
    /// Result of the comparison, without polarity, and the time since which the output has not followed it yet.
    high: [bool; 7],
    output: [bool; 7],
    follows_at: [Option<u64>; 7],
    /// Time at which a comparator that is on has started.
    started_at: [Option<u64>; 7],
}

impl Comparators {
    /// Whether a comparator is on.
    pub fn is_on(&self, n: usize) -> bool {
        self.control[n] & EN != 0
    }

    /// Returns INPSEL, the pin at its positive input.
    pub fn input_of(&self, n: usize) -> u32 {
        self.control[n] >> 8 & 1
    }

    /// Returns INMSEL, the source of its negative input.
    pub fn reference_of(&self, n: usize) -> u32 {
        self.control[n] >> 4 & 7
    }

    /// Compares the present inputs and references.
    pub fn look(&mut self, now: u64) {
        for n in 0..7 {
            let (input, reference) = (self.inputs[n], self.references[n]);
            let hysteresis = HYSTERESIS * (self.control[n] >> 16 & 7) as u16;
            let level = if self.high[n] { reference.saturating_sub(hysteresis) } else { reference };
            let high = input > level;
            if high != self.high[n] {
                self.high[n] = high;
                self.follows_at[n] = Some(now + DELAY);
            }
            if self.follows_at[n].take_if(|at| *at <= now).is_some() {
                self.output[n] = self.high[n];
            }
            self.started_at[n] = self.started_at[n].map(|at| if at <= now { 0 } else { at });
        }
    }

    /// Returns the time of the next change of an output.
    pub fn next_event(&self) -> u64 {
        let starts = self.started_at.iter().flatten().filter(|at| **at > 0);
        self.follows_at.iter().flatten().chain(starts).copied().min().unwrap_or(NEVER)
    }

    /// Returns the output of comparator `n`, counted from 0, with its polarity.
    pub fn output(&self, n: usize) -> bool {
        let control = self.control[n];
        let valid = control & EN != 0 && self.started_at[n] == Some(0);
        let valid = valid && !(self.stuck_low && n == 0);
        valid && self.output[n] != (control & POL != 0)
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let n = (offset / 4) as usize;
        Some(self.control.get(n)? | if self.output(n) { VALUE } else { 0 })
    }

    /// Writes a register; a locked register does not change.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        let n = (offset / 4) as usize;
        let before = *self.control.get(n)?;
        if before & LOCK == 0 {
            self.control[n] = value & MASK;
            match (before & EN, value & EN) {
                (0, EN) => self.started_at[n] = Some(now + START),
                (EN, 0) => self.started_at[n] = None,
                _ => {}
            }
        }
        Some(Effect::Look)
    }
}
