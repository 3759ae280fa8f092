//! ADC1 and ADC2 (RM0440, section 21): calibration, injected sequences started together by TIM1,
//! analog watchdog 1 on single injected channels. Nothing else of them is modelled.

use super::{Effect, NEVER, Plain, Store};

const ALL: u32 = u32::MAX;
const KNOWN: &[Plain] = &[
    (ISR, 0, 0),
    (IER, 0, 0x7ff),
    (CR, 0x2000_0000, 0),
    (CFGR, 0x8000_0000, ALL),
    (0x10, 0, 0),
    (SMPR1, 0, ALL),
    (SMPR1 + 4, 0, ALL),
    (TR1, 0x0fff_0000, ALL),
    (JSQR, 0, ALL),
    (JDR1, 0, 0),
    (0x84, 0, 0),
    (0x88, 0, 0),
    (0x8c, 0, 0),
    (0xb4, 0, ALL),
    (0xc0, 0, 0),
];
const ISR: u32 = 0x00;
const IER: u32 = 0x04;
const CR: u32 = 0x08;
const CFGR: u32 = 0x0c;
const SMPR1: u32 = 0x14;
const TR1: u32 = 0x20;
const JSQR: u32 = 0x4c;
const JDR1: u32 = 0x80;
/// Common control register of both.
const CCR: u32 = 0x308;
const CSR: u32 = 0x300;

const ADRDY: u32 = 1;
const JEOC: u32 = 1 << 5;
const JEOS: u32 = 1 << 6;
const AWD1: u32 = 1 << 7;
const ADEN: u32 = 1;
const JADSTART: u32 = 1 << 3;
const VREGEN: u32 = 1 << 28;
const DEEPPWD: u32 = 1 << 29;
const ADCAL: u32 = 1 << 31;
/// Sampling times, halves of a converter clock.
const SAMPLING: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];
/// A conversion after it, halves of a converter clock.
const CONVERSION: u64 = 25;

/// A converter.
#[derive(Clone, Debug)]
struct Converter {
    store: Store,
    status: u32,
    control: u32,
    /// Rank that is being converted, and when it will be.
    rank: u32,
    done_at: u64,
    data: [u16; 4],
}

impl Default for Converter {
    fn default() -> Self {
        Self {
            store: Store::new(KNOWN),
            status: 0,
            control: DEEPPWD,
            rank: 0,
            done_at: NEVER,
            data: [0; 4],
        }
    }
}

/// Codes at the pins by channel, 0 to 18.
pub type Inputs = [u16; 19];

/// Both converters.
#[derive(Clone, Debug, Default)]
pub struct Adc {
    converters: [Converter; 2],
    common: u32,
    /// Codes at their pins.
    pub inputs: [Inputs; 2],
    /// Triggers to be lost, for each converter.
    pub lose_triggers: [u32; 2],
}

impl Adc {
    /// Ticks per half of a converter clock.
    fn half_clock(&self) -> u64 {
        // Synchronous clock, divided by 1, 2 or 4.
        [4, 1, 2, 4][(self.common >> 16 & 3) as usize] / 2
    }

    /// The trigger output 2 of TIM1 rises.
    pub fn trigger(&mut self, at: u64) {
        let half_clock = self.half_clock();
        for (n, one) in self.converters.iter_mut().enumerate() {
            if one.control & JADSTART == 0 {
                continue;
            }
            if self.lose_triggers[n] > 0 {
                self.lose_triggers[n] -= 1;
                continue;
            }
            // Rising edge, TIM1_TRGO2.
            if one.store.get(JSQR) >> 2 & 0x7f == 1 << 5 | 8 && one.done_at == NEVER {
                one.rank = 0;
                one.done_at = at + one.conversion(0) * half_clock;
            }
        }
    }

    /// When the conversions of each converter sample, in order: channel and time, ticks. Of the sequences in progress,
    /// else of those that a trigger at this time would start.
    pub fn samplings(&self, trigger: Option<u64>) -> [Vec<(u32, u64)>; 2] {
        let half_clock = self.half_clock();
        [0, 1].map(|n| {
            let one = &self.converters[n];
            let (first, mut ends) = match (one.done_at, trigger) {
                (NEVER, None) => return Vec::new(),
                (NEVER, Some(at)) => (0, at + one.conversion(0) * half_clock),
                (done_at, _) => (one.rank, done_at),
            };
            let ranks = first..=one.store.get(JSQR) & 3;
            ranks
                .map(|rank| {
                    if rank > first {
                        ends += one.conversion(rank) * half_clock;
                    }
                    (one.channel(rank), ends - CONVERSION * half_clock)
                })
                .collect()
        })
    }

    /// When the next conversion ends.
    pub fn next_event(&self) -> u64 {
        self.converters[0].done_at.min(self.converters[1].done_at)
    }

    /// Ends conversions that are due.
    pub fn happen(&mut self, now: u64) {
        let half_clock = self.half_clock();
        for (one, inputs) in self.converters.iter_mut().zip(&self.inputs) {
            while one.done_at <= now {
                let channel = one.channel(one.rank);
                let code = inputs.get(channel as usize).copied().unwrap_or(0);
                one.data[one.rank as usize & 3] = code;
                one.status |= JEOC;
                one.watch(channel, code);
                if one.rank == one.store.get(JSQR) & 3 {
                    one.status |= JEOS;
                    one.done_at = NEVER;
                } else {
                    one.rank += 1;
                    one.done_at += one.conversion(one.rank) * half_clock;
                }
            }
        }
    }

    /// Whether any enabled event asks for the interrupt.
    pub fn requests(&self) -> bool {
        self.converters.iter().any(|one| one.status & one.store.get(IER) != 0)
    }

    /// Whether the sequences of both have ended and were not looked at yet.
    pub fn ended(&self) -> [bool; 2] {
        [0, 1].map(|n| self.converters[n].status & JEOS != 0)
    }

    /// Whether an analog watchdog has seen its channel outside its window.
    pub fn over_current(&self) -> bool {
        self.converters.iter().any(|one| one.status & AWD1 != 0)
    }

    /// Results of the last sequences.
    pub fn data(&self) -> [[u16; 4]; 2] {
        [self.converters[0].data, self.converters[1].data]
    }

    /// Reads a register of the block that both share.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            CSR => Some(self.converters[0].status | self.converters[1].status << 16),
            CCR => Some(self.common),
            0x000..0x200 => self.converters[(offset >> 8) as usize].read(offset & 0xff),
            _ => None,
        }
    }

    /// Writes one.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<Effect> {
        match offset {
            CCR => self.common = value,
            0x000..0x200 => {
                self.converters[(offset >> 8) as usize].write(offset & 0xff, value)?;
            }
            _ => return None,
        }
        Some(if offset & 0xff <= CR { Effect::Look } else { Effect::None })
    }
}

impl Converter {
    fn channel(&self, rank: u32) -> u32 {
        // JSQ1 begins at bit 9, the others follow, six bits apart.
        self.store.get(JSQR) >> (9 + 6 * rank) & 0x1f
    }

    /// Sampling and conversion of a rank, halves of a clock.
    fn conversion(&self, rank: u32) -> u64 {
        let channel = self.channel(rank);
        let register = self.store.get(SMPR1 + 4 * (channel / 10));
        SAMPLING[(register >> (3 * (channel % 10)) & 7) as usize] + CONVERSION
    }

    fn watch(&mut self, channel: u32, code: u16) {
        let cfgr = self.store.get(CFGR);
        let (single, injected) = (cfgr >> 22 & 1 != 0, cfgr >> 24 & 1 != 0);
        let watched = injected && (!single || cfgr >> 26 & 0x1f == channel);
        let window = self.store.get(TR1);
        let code = u32::from(code);
        if watched && (code < window & 0xfff || code > window >> 16 & 0xfff) {
            self.status |= AWD1;
        }
    }

    fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            ISR => self.status,
            CR => self.control,
            JDR1 | 0x84 | 0x88 | 0x8c => u32::from(self.data[(offset - JDR1) as usize / 4]),
            _ => return self.store.read(offset),
        })
    }

    fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            ISR => self.status &= !value,
            CR => self.order(value)?,
            _ => {
                self.store.write(offset, value)?;
            }
        }
        Some(())
    }

    /// The control register: a calibration and the start-up take no time. `None` is
    /// forbidden by the manual: calibration without regulator or while enabled, enabling without regulator.
    fn order(&mut self, value: u32) -> Option<()> {
        let ready = self.control & VREGEN != 0 && self.control & DEEPPWD == 0;
        if value & ADCAL != 0 && (!ready || self.control & ADEN != 0) {
            return None;
        }
        let config = DEEPPWD | VREGEN | 1 << 30;
        self.control = self.control & !config | value & config;
        if value & ADEN != 0 {
            if !ready {
                return None;
            }
            self.control |= ADEN;
            self.status |= ADRDY;
        }
        if value & 1 << 1 != 0 {
            self.control &= !(ADEN | JADSTART);
        }
        if value & JADSTART != 0 {
            if self.control & ADEN == 0 {
                return None;
            }
            self.control |= JADSTART;
        }
        // Stop of injected conversions.
        if value & 1 << 5 != 0 {
            self.control &= !JADSTART;
            self.done_at = NEVER;
        }
        Some(())
    }
}
