//! TIM5 and TIM16 as time bases (RM0440, sections 30 and 31): they count core clocks up while they are enabled, also while
//! the core sleeps or is halted. Channel 1 captures every eighth edge of an oscillator inside the chip.

use super::{Effect, Store, bits, offsets};

offsets! { CR1 = 0x00, SR = 0x10, EGR = 0x14, CCMR1 = 0x18, CCER = 0x20, CNT = 0x24, CCR1 = 0x34, TISEL = 0x5c }
// SR: a capture that was not read, and another one after it.
bits! { CC1IF = 1, CC1OF = 9 }
/// Number of edges of the oscillator per capture.
const EDGES: f64 = 8.0;

defaults! {
    /// The captures while the channel is on.
    #[derive(Clone, Copy, Debug)]
    pub struct Captures {
        /// Ticks from one capture to the next.
        ticks: f64 = f64::INFINITY,
        /// A time, and the number of captures until then.
        from: (u64, f64),
        /// Number of captures up to the last one that was read.
        read: u64,
    }
}

defaults! {
    /// The timer.
    #[derive(Clone, Debug)]
    pub struct TimeBase {
        store: Store = Store::of("TIM5"),
        /// The number of the input with the oscillator (TISEL).
        input: u32 = 1,
        /// Bits of the counter.
        bits: u32 = u32::MAX,
        /// Time at which the counter was 0.
        from: u64,
        pub(crate) captures: Captures,
    }
}

impl TimeBase {
    /// Makes TIM16, whose input 2 is MCO.
    pub fn tim16() -> Self {
        Self { store: Store::of("TIM16"), input: 2, bits: 0xffff, ..Self::default() }
    }

    /// Accounts for a stop of its clock for some ticks.
    pub fn delay(&mut self, ticks: u64) {
        self.from += ticks;
    }

    /// Sets the ticks from one edge of the oscillator to the next; infinite stops it.
    pub fn set_oscillator(&mut self, ticks: f64, now: u64) {
        let captures = &mut self.captures;
        captures.from = (now, captures.so_far(now));
        captures.ticks = EDGES * ticks;
    }

    /// Reads a register at the time `now`, ticks.
    pub fn read(&mut self, offset: u32, now: u64, oscillates: bool) -> Option<u32> {
        // The counter is read in loops.
        if offset == CNT {
            let counts = self.store.get(CR1) & 1 != 0;
            return Some(if counts { (now - self.from) as u32 & self.bits } else { 0 });
        }
        // TI1 on channel 1, every eighth edge; the input is the oscillator.
        let (mode, input) = (self.store.get(CCMR1) & 0xff, self.store.get(TISEL) & 15);
        let on = oscillates && self.store.get(CCER) & 1 != 0 && (mode, input) == (0xd, self.input);
        let captures = &mut self.captures;
        let count = if on { captures.so_far(now) as u64 } else { captures.read };
        match offset {
            SR => Some(match count.saturating_sub(captures.read) {
                0 => 0,
                1 => CC1IF,
                _ => CC1IF | CC1OF,
            }),
            CCR1 => {
                captures.read = count;
                let (at, before) = captures.from;
                let ticks = (count as f64 - before) * captures.ticks;
                Some((at as f64 + ticks - self.from as f64) as i64 as u32 & self.bits)
            }
            _ => self.store.read(offset),
        }
    }

    /// Writes a register at the time `now`, ticks.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        let counts = self.store.get(CR1) & 1 != 0;
        self.store.write(offset, value)?;
        if offset == SR {
            self.captures.read = self.captures.so_far(now) as u64;
        }
        if offset == EGR || (offset == CR1 && !counts) {
            self.from = now;
        }
        Some(Effect::None)
    }
}

impl Captures {
    fn so_far(&self, now: u64) -> f64 {
        self.from.1 + (now - self.from.0) as f64 / self.ticks
    }
}
