//! ADC1 and ADC2, or ADC3 and ADC4 (RM0440, section 21): start-up with its times, sequences started together by a trigger output of TIM1 or by
//! software, analog watchdog 1 on single channels. Nothing else of them is modelled.

mod converter;

use super::{Effect, NEVER, Store, bits, offsets};
use crate::rules::{Rule, Rules};
use converter::{Converter, EOC, JEOC, JEOS, Sequence};

offsets! {
    ISR = 0x00, IER = 0x04, CR = 0x08, CFGR = 0x0c, SMPR1 = 0x14, TR1 = 0x20, SQR1 = 0x30, DR = 0x40, JSQR = 0x4c, JDR1 = 0x80,
    JDR4 = 0x8c
}
// Common to both.
offsets! { CSR = 0x300, CCR = 0x308 }
const VREFEN: u32 = 1 << 22;

/// Codes at the pins by channel, 0 to 18.
pub type Inputs = [u16; 19];

/// Both converters.
#[derive(Clone, Debug, Default)]
pub struct Adc {
    converters: [Converter; 2],
    common: u32,
    /// Codes at their pins.
    pub inputs: [Inputs; 2],
    /// Code of the reference inside the chip, at channel 18 of the first while CCR connects it.
    pub own_reference: u16,
    /// Triggers to be lost, for each converter.
    pub lose_triggers: [u32; 2],
    /// Number of the first, less one.
    first: u32,
    /// Whether RCC gives them a clock of their own.
    pub kernel_clock: bool,
    /// Channels that each converter has converted since they were taken.
    converted: [u32; 2],
}

impl Adc {
    /// A pair; the first has this number, less one.
    pub fn from(first: u32) -> Self {
        Self { first, ..Self::default() }
    }

    /// Ticks per converter clock; `None` is no clock.
    fn clock(&self) -> Option<u64> {
        // The own clock, taken as that of the core, divided by PRESC; or synchronous, divided by 1, 2 or 4.
        const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];
        match self.common >> 16 & 3 {
            0 if !self.kernel_clock => None,
            0 => PRESCALERS.get((self.common >> 18 & 15) as usize).copied(),
            mode => Some(1 << (mode - 1)),
        }
    }

    /// A trigger output of TIM1, 0 or 1, rises.
    pub fn trigger(&mut self, at: u64, output: usize) {
        let Some(clock) = self.clock() else { return };
        for (n, one) in self.converters.iter_mut().enumerate() {
            let waits = |sequence: &Sequence| one.waits_for(*sequence, output);
            let Some(sequence) = Sequence::ALL.into_iter().find(waits) else { continue };
            if self.lose_triggers[n] > 0 {
                self.lose_triggers[n] -= 1;
                continue;
            }
            one.begin(sequence, at, clock);
        }
    }

    /// How long the reference inside the chip is sampled, ticks.
    pub fn own_reference_ticks(&self) -> u64 {
        self.converters[0].sampling(18) * self.clock().unwrap_or(1) / 2
    }

    /// Whether a trigger at this time starts a sequence in the middle of a regular conversion.
    pub fn disturbs(&self, at: u64, output: usize) -> bool {
        self.converters.iter().any(|one| one.disturbs(at, output))
    }

    /// Whether TIM1 starts regular conversions.
    pub fn samples_twice(&self) -> bool {
        self.converters.iter().any(Converter::samples_twice)
    }

    /// When the conversions of each converter sample, in order: channel and time, ticks. Of the sequences in progress,
    /// else of those that a trigger at this time would start.
    pub fn samplings(&self, trigger: Option<u64>) -> [Vec<(u32, u64)>; 2] {
        let clock = self.clock().unwrap_or(1);
        [0, 1].map(|n| self.converters[n].samplings(trigger, clock))
    }

    /// When the next conversion ends, or a converter gets ready.
    pub fn next_event(&self) -> u64 {
        self.converters[0].next_event().min(self.converters[1].next_event())
    }

    /// Ends conversions that are due.
    pub fn happen(&mut self, now: u64) {
        let clock = self.clock().unwrap_or(1);
        self.inputs[0][18] = if self.common & VREFEN != 0 { self.own_reference } else { 0 };
        for (n, one) in self.converters.iter_mut().enumerate() {
            self.converted[n] |= one.happen(now, clock, &self.inputs[n]);
        }
    }

    /// Channels that each converter has converted since the last call, as bits.
    pub fn take_converted(&mut self) -> [u32; 2] {
        std::mem::take(&mut self.converted)
    }

    /// Whether any enabled event asks for the interrupt.
    pub fn requests(&self) -> bool {
        self.converters.iter().any(Converter::requests)
    }

    /// Whether the sequence of the second has ended and was not looked at yet, and whether all else was converted.
    pub fn ended(&self) -> (bool, bool) {
        let [one, two] = &self.converters;
        let regular =
            [one, two].into_iter().all(|one| !one.samples_twice() || one.status & EOC != 0);
        (two.status & JEOS != 0, one.status & JEOC != 0 && regular)
    }

    /// Whether an analog watchdog has seen its channel outside its window.
    pub fn over_current(&self) -> bool {
        self.converters.iter().any(|one| one.status & converter::AWD1 != 0)
    }

    /// Results of the last sequences, and of the regular conversions that TIM1 has started.
    pub fn data(&self) -> [([u16; 4], u16); 2] {
        let regular = |one: &Converter| if one.samples_twice() { one.regular } else { 0 };
        [0, 1].map(|n| (self.converters[n].data, regular(&self.converters[n])))
    }

    /// Reads a register of the block that both share.
    pub fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        self.happen(now);
        match offset {
            CSR => Some(self.converters[0].status | self.converters[1].status << 16),
            CCR => Some(self.common),
            0x000..0x200 => self.converters[(offset >> 8) as usize].read(offset & 0xff, now),
            _ => None,
        }
    }

    /// Writes one.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Rules) -> Option<Effect> {
        self.happen(rules.now);
        match offset {
            CCR => self.common = value & 0x01ff_ef1f,
            0x000..0x200 => {
                let (n, clock, first) = (offset >> 8, self.clock(), self.first);
                let one = &mut self.converters[n as usize];
                one.write(offset & 0xff, value, &mut Named { rules, n: first + n + 1, clock })?;
            }
            _ => return None,
        }
        Some(if offset & 0xff <= CR { Effect::Look } else { Effect::None })
    }
}

/// The rules and the clock, for one converter.
struct Named<'a> {
    rules: &'a mut Rules,
    n: u32,
    /// Ticks per clock of the converter; none is no clock.
    clock: Option<u64>,
}

impl Named<'_> {
    fn require(&mut self, kept: bool, rule: Rule, text: &str) -> bool {
        self.rules.require(kept, rule, || format!("ADC{}: {text}", self.n))
    }
}
