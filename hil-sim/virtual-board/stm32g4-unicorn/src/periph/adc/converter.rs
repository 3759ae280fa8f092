//! One ADC.

use super::{
    CFGR, CR, DR, IER, ISR, Inputs, JDR1, JDR4, JSQR, NEVER, Named, SMPR1, SQR1, Store, TR1, bits,
};
use crate::rules::Rule;

// ISR: ready; ends of a regular conversion and sequence, and of injected ones; analog watchdog 1.
bits! { pub(super) ADRDY = 0, pub(super) EOC = 2, pub(super) EOS = 3 }
bits! { pub(super) JEOC = 5, pub(super) JEOS = 6, pub(super) AWD1 = 7 }
// CR.
bits! { ADEN = 0, ADDIS = 1, ADSTART = 2, JADSTART = 3, VREGEN = 28, DEEPPWD = 29, ADCALDIF = 30, ADCAL = 31 }
// CFGR.
bits! { CONT = 13, JQDIS = 31 }

/// Sampling times, halves of an ADC clock.
const SAMPLING: [u64; 8] = [5, 13, 25, 49, 95, 185, 495, 1281];
/// Duration of a conversion after the sampling, halves of an ADC clock.
const CONVERSION: u64 = 25;
/// Start-up of the regulator, ticks: 20 us (datasheet).
const REGULATOR: u64 = 20 * 170;
/// Duration of a calibration, and of the wait after it, ADC clocks (datasheet, tCAL; RM0440, ADCAL).
const CALIBRATION: u64 = 116;
const AFTER_CALIBRATION: u64 = 4;
/// Start-up time, ADC clocks: one conversion (datasheet, tSTAB).
const START_UP: u64 = 15;

/// Kind of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sequence {
    /// `SQR1` to `SQR4`.
    Regular,
    /// `JSQR`.
    Injected,
}

impl Sequence {
    /// Both kinds.
    pub const ALL: [Self; 2] = [Self::Regular, Self::Injected];

    /// Returns the bit of CR that is set while it waits or runs.
    fn started(self) -> u32 {
        [ADSTART, JADSTART][self as usize]
    }
}

/// A running sequence: its rank, and the time at which that rank is converted.
#[derive(Clone, Copy, Debug)]
struct Running {
    rank: u32,
    done_at: u64,
}

const IDLE: Running = Running { rank: 0, done_at: NEVER };

defaults! {
    /// An ADC.
    #[derive(Clone, Debug)]
    pub(super) struct Converter {
        store: Store = Store::of("ADC"),
        /// ISR.
        pub status: u32,
        control: u32 = DEEPPWD,
        running: [Running; 2] = [IDLE; 2],
        /// Injected data.
        pub data: [u16; 4],
        /// Regular data.
        pub regular: u16,
        /// Time since which the regulator is on.
        regulator_from: u64 = NEVER,
        /// End of the last calibration, and end of the start-up.
        calibrated_at: u64,
        ready_at: u64 = NEVER,
        ready: bool,
    }
}

impl Converter {
    /// Whether any enabled event requests the interrupt.
    pub fn requests(&self) -> bool {
        self.status & self.store.get(IER) != 0
    }

    /// Whether an edge of a trigger output of TIM1 starts a sequence.
    pub fn waits_for(&self, sequence: Sequence, output: usize) -> bool {
        let code = [[9, 10, 10], [0, 8, 8]][sequence as usize][output];
        let edge = [1, 1, 2][output];
        let idle = self.running[sequence as usize].done_at == NEVER;
        self.control & sequence.started() != 0
            && idle
            && self.selection(sequence) == edge << 5 | code
    }

    /// Returns the end of the sampling of the first channel of a sequence that is in progress; otherwise 0.
    pub fn sampling_first_until(&self, clock: u64) -> u64 {
        let first = self.running.iter().filter(|one| one.done_at < NEVER && one.rank == 0);
        first.map(|one| one.done_at - CONVERSION * clock / 2).max().unwrap_or(0)
    }

    /// Returns the end of the conversion in progress.
    pub fn conversion_until(&self) -> u64 {
        self.running[0].done_at.min(self.running[1].done_at)
    }

    /// Whether a trigger at this time starts the injected sequence in the middle of a regular conversion.
    pub fn disturbs(&self, at: u64, output: usize) -> bool {
        let done_at = self.running[Sequence::Regular as usize].done_at;
        self.waits_for(Sequence::Injected, output) && (at + 1..NEVER).contains(&done_at)
    }

    /// Whether a trigger starts the regular sequence.
    pub fn samples_twice(&self) -> bool {
        self.control & ADSTART != 0 && self.is_triggered(Sequence::Regular)
    }

    /// Returns the trigger of a sequence, with its edges in the two bits above.
    fn selection(&self, sequence: Sequence) -> u32 {
        let (register, place) = [(CFGR, 5), (JSQR, 2)][sequence as usize];
        self.store.get(register) >> place & 0x7f
    }

    fn is_triggered(&self, sequence: Sequence) -> bool {
        self.selection(sequence) >> 5 != 0
    }

    /// Starts a sequence.
    pub fn begin(&mut self, sequence: Sequence, at: u64, clock: u64) {
        let done_at = at + self.conversion(sequence, 0) * clock / 2;
        self.running[sequence as usize] = Running { rank: 0, done_at };
    }

    /// Returns the sampling instants of the injected conversions: channel and time. They belong to the sequence in
    /// progress, or otherwise to the one that a trigger at this time would start.
    pub fn samplings(&self, trigger: Option<u64>, clock: u64) -> Vec<(u32, u64)> {
        let sequence = Sequence::Injected;
        let lasts = |rank| self.conversion(sequence, rank) * clock / 2;
        let running = self.running[sequence as usize];
        let (first, mut ends) = match (running.done_at, trigger) {
            (NEVER, None) => return Vec::new(),
            (NEVER, Some(at)) => (0, at + lasts(0)),
            (done_at, _) => (running.rank, done_at),
        };
        let sampling = |rank| {
            if rank > first {
                ends += lasts(rank);
            }
            (self.channel(sequence, rank), ends - CONVERSION * clock / 2)
        };
        (first..=self.last(sequence)).map(sampling).collect()
    }

    /// Returns the time at which the next conversion or the start-up ends.
    pub fn next_event(&self) -> u64 {
        self.running[0].done_at.min(self.running[1].done_at).min(self.ready_at)
    }

    fn channel(&self, sequence: Sequence, rank: u32) -> u32 {
        match sequence {
            // JSQ1 begins at bit 9; the others follow in steps of six bits.
            Sequence::Injected => self.store.get(JSQR) >> (9 + 6 * rank) & 0x1f,
            // SQ1 begins at bit 6 of SQR1; five fit in a register.
            Sequence::Regular => {
                let place = rank + 1;
                self.store.get(SQR1 + 4 * (place / 5)) >> (6 * (place % 5)) & 0x1f
            }
        }
    }

    /// Returns the last rank of a sequence.
    fn last(&self, sequence: Sequence) -> u32 {
        let (register, mask) = [(SQR1, 15), (JSQR, 3)][sequence as usize];
        self.store.get(register) & mask
    }

    /// Returns the time of sampling and conversion of a rank, halves of a clock.
    fn conversion(&self, sequence: Sequence, rank: u32) -> u64 {
        self.sampling(self.channel(sequence, rank)) + CONVERSION
    }

    /// Returns the sampling time of a channel, halves of a clock.
    pub fn sampling(&self, channel: u32) -> u64 {
        let register = self.store.get(SMPR1 + 4 * (channel / 10).min(1));
        SAMPLING[(register >> (3 * (channel % 10)) & 7) as usize]
    }

    /// Ends conversions that are due; returns the converted channels, as bits.
    pub fn happen(&mut self, now: u64, clock: u64, inputs: &Inputs) -> u32 {
        if self.ready_at <= now {
            self.ready_at = NEVER;
            self.ready = true;
            self.status |= ADRDY;
        }
        let mut converted = 0;
        for sequence in Sequence::ALL {
            while self.running[sequence as usize].done_at <= now {
                let Running { rank, done_at } = self.running[sequence as usize];
                let channel = self.channel(sequence, rank);
                converted |= 1 << channel;
                let code = inputs.get(channel as usize).copied().unwrap_or(0);
                self.take(sequence, rank, channel, code);
                self.running[sequence as usize] = if rank == self.last(sequence) {
                    self.end(sequence, done_at)
                } else {
                    let rank = rank + 1;
                    let lasts = self.conversion(sequence, rank) * clock / 2;
                    Running { rank, done_at: done_at + lasts }
                };
            }
        }
        converted
    }

    fn take(&mut self, sequence: Sequence, rank: u32, channel: u32, code: u16) {
        match sequence {
            Sequence::Injected => self.data[rank as usize & 3] = code,
            Sequence::Regular => self.regular = code,
        }
        self.status |= [EOC, JEOC][sequence as usize];
        self.watch(sequence, channel, code);
    }

    /// Ends a sequence; returns the sequences that run now.
    fn end(&mut self, sequence: Sequence, at: u64) -> Running {
        self.status |= [EOS, JEOS][sequence as usize];
        if sequence == Sequence::Regular && self.store.get(CFGR) & CONT != 0 {
            return Running { rank: 0, done_at: at + self.conversion(sequence, 0) };
        }
        // Without a trigger it runs once.
        if !self.is_triggered(sequence) {
            self.control &= !sequence.started();
        }
        IDLE
    }

    fn watch(&mut self, sequence: Sequence, channel: u32, code: u16) {
        let cfgr = self.store.get(CFGR);
        // AWD1EN and JAWD1EN.
        let (single, enabled) = (cfgr >> 22 & 1 != 0, cfgr >> (23 + sequence as u32) & 1 != 0);
        let watched = enabled && (!single || cfgr >> 26 & 0x1f == channel);
        let window = self.store.get(TR1);
        let code = u32::from(code);
        if watched && (code < window & 0xfff || code > window >> 16 & 0xfff) {
            self.status |= AWD1;
        }
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        Some(match offset {
            ISR => self.status,
            CR => self.control | if now < self.calibrated_at { ADCAL } else { 0 },
            DR => {
                self.status &= !EOC;
                u32::from(self.regular)
            }
            JDR1..=JDR4 => u32::from(self.data[(offset - JDR1) as usize / 4]),
            _ => return self.store.read(offset),
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Named) -> Option<()> {
        match offset {
            ISR => self.status &= !value,
            CR => self.order(value, rules),
            JSQR => {
                let queue = self.store.get(CFGR) & JQDIS == 0;
                let free = queue || self.control & JADSTART == 0;
                if rules.require(free, Rule::JsqrStarted, "JSQR while JADSTART is set, JQDIS = 1") {
                    self.store.write(JSQR, value)?;
                }
            }
            _ => return self.store.write(offset, value).map(drop),
        }
        Some(())
    }

    fn order(&mut self, value: u32, rules: &mut Named) {
        let (now, clock) = (rules.rules.now, rules.clock);
        let config = DEEPPWD | VREGEN | ADCALDIF;
        let before = self.control;
        self.control = self.control & !config | value & config;
        if self.control & VREGEN == 0 || self.control & DEEPPWD != 0 {
            self.regulator_from = NEVER;
            self.control &= !(ADEN | ADSTART | JADSTART);
            self.ready = false;
        } else if before & (VREGEN | DEEPPWD) != VREGEN {
            self.regulator_from = now;
        }
        let powered = self.regulator_from.saturating_add(REGULATOR) <= now;
        let calibrating = now < self.calibrated_at;
        if value & ADCAL != 0 && !calibrating {
            let off = self.control & ADEN == 0;
            let allowed = rules.require(
                powered && off,
                Rule::AdcEarly,
                "ADCAL before its regulator is up for 20 us, or while ADEN is set",
            );
            let has_clock = rules.require(clock.is_some(), Rule::AdcClock, "ADCAL without a clock");
            if allowed {
                // Without a clock the calibration never ends.
                let lasts = if has_clock { CALIBRATION * clock.unwrap_or(1) } else { NEVER };
                self.calibrated_at = now.saturating_add(lasts);
            }
        }
        if value & ADEN != 0 && self.control & ADEN == 0 {
            let settled = self.calibrated_at.saturating_add(AFTER_CALIBRATION * clock.unwrap_or(1));
            let allowed = rules.require(powered && settled <= now, Rule::AdcEarly, "ADEN before its regulator is up for 20 us, or less than 4 clocks after the calibration");
            let has_clock = rules.require(clock.is_some(), Rule::AdcClock, "ADEN without a clock");
            if allowed && has_clock {
                self.control |= ADEN;
                self.ready_at = now + START_UP * clock.unwrap_or(1);
            }
        }
        if value & ADDIS != 0 {
            self.control &= !(ADEN | ADSTART | JADSTART);
            self.ready = false;
            self.ready_at = NEVER;
        }
        for sequence in Sequence::ALL {
            let bit = sequence.started();
            if value & !self.control & bit != 0
                && rules.require(self.ready, Rule::AdcEarly, "a conversion started before ADRDY")
            {
                self.control |= bit;
                if !self.is_triggered(sequence) {
                    self.begin(sequence, now, clock.unwrap_or(1));
                }
            }
            // ADSTP and JADSTP.
            if value & bit << 2 != 0 {
                self.control &= !bit;
                self.running[sequence as usize] = IDLE;
            }
        }
    }
}
