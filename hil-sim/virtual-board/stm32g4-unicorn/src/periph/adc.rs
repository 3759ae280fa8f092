//! ADC1 and ADC2, or ADC3 and ADC4 (RM0440, section 21): start-up with its times, sequences started together by a
//! trigger output of TIM1 or by software, analog watchdog 1 on single channels. Nothing else of the ADCs is modelled.

mod converter;

use super::{Effect, NEVER, Store, bits, offsets};
use crate::rules::{Rule, Rules};
use converter::{Converter, EOC, JEOC, JEOS, Sequence};

offsets! {
    ISR = 0x00, IER = 0x04, CR = 0x08, CFGR = 0x0c, SMPR1 = 0x14, TR1 = 0x20, SQR1 = 0x30, DR = 0x40, JSQR = 0x4c, JDR1 = 0x80,
    JDR4 = 0x8c
}
// Registers common to both.
offsets! { CSR = 0x300, CCR = 0x308 }
const VREFEN: u32 = 1 << 22;

/// ADC counts at the pins by channel, 0 to 18.
pub type Inputs = [u16; 19];

/// A pair of ADCs.
#[derive(Clone, Debug, Default)]
pub struct Adc {
    converters: [Converter; 2],
    common: u32,
    /// ADC counts at their pins.
    pub inputs: [Inputs; 2],
    /// ADC counts of the chip's internal reference, at channel 18 of the first ADC while CCR connects it.
    pub own_reference: u16,
    /// Number of triggers to be lost, for each ADC.
    pub lose_triggers: [u32; 2],
    /// Number of the first ADC, minus one.
    first: u32,
    /// Whether RCC gives them a clock of their own.
    pub kernel_clock: bool,
    /// Channels that each ADC has converted since the last fetch.
    converted: [u32; 2],
}

impl Adc {
    /// Makes a pair; the first ADC has this number, minus one.
    pub fn from(first: u32) -> Self {
        Self { first, ..Self::default() }
    }

    /// Returns the ticks per ADC clock; `None` is no clock.
    fn clock(&self) -> Option<u64> {
        // Either their own clock, assumed to be that of the core, divided by PRESC; or the synchronous clock, divided by 1, 2 or 4.
        const PRESCALERS: [u64; 12] = [1, 2, 4, 6, 8, 10, 12, 16, 32, 64, 128, 256];
        match self.common >> 16 & 3 {
            0 if !self.kernel_clock => None,
            0 => PRESCALERS.get((self.common >> 18 & 15) as usize).copied(),
            mode => Some(1 << (mode - 1)),
        }
    }

    /// Processes an edge of a trigger output of TIM1: a rising one, 0 or 1, or the falling one of output 1, 2.
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

    /// Returns the sampling time of the chip's internal reference, ticks.
    pub fn own_reference_ticks(&self) -> u64 {
        self.converters[0].sampling(18) * self.clock().unwrap_or(1) / 2
    }

    /// Whether a trigger at this time starts a sequence in the middle of a regular conversion.
    pub fn disturbs(&self, at: u64, output: usize) -> bool {
        self.converters.iter().any(|one| one.disturbs(at, output))
    }

    /// Whether any ADC samples the first channel of a sequence, which is a current, right behind this time.
    pub fn samples_current(&self, at: u64) -> bool {
        let clock = self.clock().unwrap_or(1);
        self.converters.iter().any(|one| one.sampling_first_until(clock) > at)
    }

    /// Whether any ADC converts something right behind this time.
    pub fn converts(&self, at: u64) -> bool {
        self.converters.iter().any(|one| (at + 1..NEVER).contains(&one.conversion_until()))
    }

    /// Whether TIM1 starts regular conversions.
    pub fn samples_twice(&self) -> bool {
        self.converters.iter().any(Converter::samples_twice)
    }

    /// Returns the sampling instants of the conversions of each ADC, in order: channel and time, ticks. They belong to
    /// the sequences in progress, or otherwise to those that a trigger at this time would start.
    pub fn samplings(&self, trigger: Option<u64>) -> [Vec<(u32, u64)>; 2] {
        let clock = self.clock().unwrap_or(1);
        [0, 1].map(|n| self.converters[n].samplings(trigger, clock))
    }

    /// Returns the time at which the next conversion ends, or an ADC gets ready.
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

    /// Returns the channels that each ADC has converted since the last call, as bits.
    pub fn take_converted(&mut self) -> [u32; 2] {
        std::mem::take(&mut self.converted)
    }

    /// Whether any enabled event requests the interrupt.
    pub fn requests(&self) -> bool {
        self.converters.iter().any(Converter::requests)
    }

    /// Returns whether the sequence of the second ADC has ended and its flag was not read yet, and whether everything else was converted.
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

    /// Returns the results of the last sequences, and of the regular conversions that TIM1 has started.
    pub fn data(&self) -> [([u16; 4], u16); 2] {
        let regular = |one: &Converter| if one.samples_twice() { one.regular } else { 0 };
        [0, 1].map(|n| (self.converters[n].data, regular(&self.converters[n])))
    }

    /// Reads a register of the block that both ADCs share.
    pub fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        self.happen(now);
        match offset {
            CSR => Some(self.converters[0].status | self.converters[1].status << 16),
            CCR => Some(self.common),
            0x000..0x200 => self.converters[(offset >> 8) as usize].read(offset & 0xff, now),
            _ => None,
        }
    }

    /// Writes a register of the block that both ADCs share.
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

/// The rules and the clock, for one ADC.
struct Named<'a> {
    rules: &'a mut Rules,
    n: u32,
    /// Ticks per clock of the ADC; none is no clock.
    clock: Option<u64>,
}

impl Named<'_> {
    fn require(&mut self, kept: bool, rule: Rule, text: &str) -> bool {
        self.rules.require(kept, rule, || format!("ADC{}: {text}", self.n))
    }
}
