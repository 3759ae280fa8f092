//! Two of the DACs (RM0440, section 22), 12 bits right-aligned, without triggers: 1 and 3.

use super::{Effect, NEVER, Store, offsets};
use crate::rules::{Rule, Rules};

offsets! { CR = 0x00, SR = 0x34, MCR = 0x3c }
const DHR: [u32; 2] = [0x08, 0x14];
const DOR: [u32; 2] = [0x2c, 0x30];
/// DACxRDY of channel 1; the bits of channel 2 are 16 places higher.
const RDY: u32 = 1 << 11;
/// Time from the enable bit to a valid output without buffer, ticks: 8 us (datasheet, tWAKEUP).
const WAKE_UP: u64 = 8 * 170;
/// Time from one output value to another, ticks: 3 us (datasheet, tSETTLING).
const SETTLING: u64 = 3 * 170;

defaults! {
    /// A channel; by default off.
    #[derive(Clone, Copy, Debug)]
    struct Channel {
        ready_at: u64 = NEVER,
        settled_at: u64 = NEVER,
        /// The counts to which the output had settled before.
        before: u16,
        code: u16,
        has_data: bool,
        seen_ready: bool,
    }
}

impl Channel {
    fn output(&self, now: u64) -> u16 {
        if now >= self.settled_at { self.code } else { self.before }
    }

    fn go_to(&mut self, code: u16, now: u64, lasts: u64) {
        self.before = self.output(now);
        self.code = code;
        self.settled_at = (now + lasts).max(if self.ready_at == NEVER { 0 } else { self.ready_at });
    }
}

defaults! {
    /// A DAC.
    #[derive(Clone, Debug)]
    pub struct Dac {
        /// Its number in the names of registers.
        pub number: u32,
        store: Store = Store::of("DAC"),
        channels: [Channel; 2],
    }
}

impl Dac {
    /// Makes the DAC with this number.
    pub fn new(number: u32) -> Self {
        Self { number, ..Self::default() }
    }

    /// Returns the output of channel 1, counts.
    pub fn code(&self, now: u64) -> u16 {
        self.channels[0].output(now)
    }

    /// Whether the program has read that channel 1 is ready.
    pub fn seen_ready(&self) -> bool {
        self.channels[0].seen_ready
    }

    /// Returns the time at which an output settles next.
    pub fn next_event(&self, now: u64) -> u64 {
        let settled = self.channels.iter().map(|channel| channel.settled_at);
        settled.filter(|at| *at > now).min().unwrap_or(NEVER)
    }

    /// Reads a register.
    pub fn read(&mut self, offset: u32, now: u64) -> Option<u32> {
        let Self { store, channels, .. } = self;
        let value = store.read(offset)?;
        if let Some(n) = DOR.iter().position(|known| *known == offset) {
            return Some(u32::from(channels[n].code));
        }
        if offset != SR {
            return Some(value);
        }
        Some((0..2).fold(0, |word, n| {
            let ready = channels[n].ready_at <= now;
            channels[n].seen_ready |= ready;
            word | if ready { RDY << (16 * n) } else { 0 }
        }))
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, rules: &mut Rules) -> Option<Effect> {
        let now = rules.now;
        let Self { number, store, channels } = self;
        let on = |store: &Store, n: usize| store.get(CR) >> (16 * n) & 1 != 0;
        let was = [on(store, 0), on(store, 1)];
        if offset == MCR {
            for n in 0..2 {
                let mode = |value: u32| value >> (16 * n) & 7;
                if mode(value) == mode(store.get(MCR)) {
                    continue;
                }
                rules.require(!was[n], Rule::DacMode, || format!("DAC{number}_MCR while it is on"));
                rules.require(channels[n].has_data, Rule::DacMode, || {
                    format!("DAC{number}_MCR before the first data of channel {}", n + 1)
                });
            }
            if was.contains(&true) {
                return Some(Effect::None);
            }
        }
        store.write(offset, value)?;
        for n in 0..2 {
            let channel = &mut channels[n];
            // The data for double data mode are in the bits above.
            let data = (store.get(DHR[n]) & 0xfff) as u16;
            if offset == DHR[n] {
                channel.has_data = true;
                if was[n] {
                    channel.go_to(data, now, SETTLING);
                }
            } else if on(store, n) && !was[n] {
                channel.ready_at = now + WAKE_UP;
                channel.go_to(data, now, WAKE_UP);
            } else if was[n] && !on(store, n) {
                *channel = Channel { has_data: channel.has_data, ..Channel::default() };
            }
        }
        Some(Effect::Look)
    }
}
