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

/// A comparator.
#[derive(Clone, Debug, Default)]
pub struct Comparator {
    control: u32,
    /// ADC counts at its positive input.
    pub input: u16,
    /// ADC counts at its negative input.
    pub reference: u16,
    /// Whether its output stays low.
    pub stuck_low: bool,
    /// Result of the comparison, without polarity, and the time since which the output has not followed it yet.
    high: bool,
    output: bool,
    follows_at: Option<u64>,
    /// Whether it is on and has started, or the time at which it will have.
    started: bool,
    starts_at: Option<u64>,
}

impl Comparator {
    /// Whether it is on.
    pub fn is_on(&self) -> bool {
        self.control & EN != 0
    }

    /// Returns INPSEL, the pin at its positive input.
    pub fn input_pin(&self) -> u32 {
        self.control >> 8 & 1
    }

    /// Returns INMSEL, the source of its negative input.
    pub fn reference_source(&self) -> u32 {
        self.control >> 4 & 7
    }

    /// Compares the present input and reference.
    pub fn look(&mut self, now: u64) {
        let hysteresis = if self.high { HYSTERESIS * (self.control >> 16 & 7) as u16 } else { 0 };
        let high = self.input > self.reference.saturating_sub(hysteresis);
        if high != self.high {
            self.high = high;
            self.follows_at = Some(now + DELAY);
        }
        if self.follows_at.take_if(|at| *at <= now).is_some() {
            self.output = self.high;
        }
        self.started |= self.starts_at.take_if(|at| *at <= now).is_some();
    }

    /// Returns the time of the next change of its output.
    pub fn next_event(&self) -> u64 {
        self.follows_at.into_iter().chain(self.starts_at).min().unwrap_or(NEVER)
    }

    /// Returns its output, with its polarity.
    pub fn output(&self) -> bool {
        self.started && !self.stuck_low && self.output != (self.control & POL != 0)
    }

    /// Reads its register.
    pub fn read(&self) -> u32 {
        self.control | if self.output() { VALUE } else { 0 }
    }

    /// Writes its register, which does not change while it is locked.
    pub fn write(&mut self, value: u32, now: u64) -> Effect {
        let before = self.control;
        if before & LOCK == 0 {
            self.control = value & MASK;
            match (before & EN, value & EN) {
                (0, EN) => self.starts_at = Some(now + START),
                (EN, 0) => (self.started, self.starts_at) = (false, None),
                _ => {}
            }
        }
        Effect::Look
    }
}
