//! Serial ports with their FIFOs: LPUART1 (RM0440, section 38), and USART3 (section 37) with an RS-485 transceiver.
//! Most of their registers are the same.

use std::collections::VecDeque;

use super::{Effect, NEVER, Store, bits, offsets};

offsets! { CR1 = 0x00, CR2 = 0x04, CR3 = 0x08, BRR = 0x0c, RTOR = 0x14, ISR = 0x1c, ICR = 0x20, RDR = 0x24, TDR = 0x28 }

/// The differences between the two ports.
#[derive(Debug)]
pub struct Kind {
    name: &'static str,
    /// Smallest value of BRR, and its units per tick.
    least: u32,
    units: u64,
}

/// LPUART1.
pub const LPUART1: Kind = Kind { name: "LPUART1", least: 0x300, units: 256 };
/// USART3.
pub const USART3: Kind = Kind { name: "USART3", least: 16, units: 1 };

// CR1; PEIE enables the interrupt of PE.
bits! { UE = 0, RE = 2, TE = 3, PEIE = 8, PCE = 10, M0 = 12, RTOIE = 26, FIFOEN = 29, TXFEIE = 30 }
// CR2.
bits! { RTOEN = 23 }
// ISR; RXFF never requests an interrupt.
bits! { PE = 0, FE = 1, NE = 2, ORE = 3, RXNE = 5, TC = 6, TXE = 7, RTOF = 11, TXFE = 23 }
/// Bits of CR1 that can be changed only while the port is off: FIFOEN, OVER8, M1, M0, WAKE, PCE, PS.
const FIXED: u32 = FIFOEN | 1 << 28 | 1 << 15 | M0 | 1 << 11 | PCE | 1 << 9;
const TWO_STOPS: u32 = 2 << 12;
/// Bytes that a FIFO holds.
const FIFO: usize = 8;

/// Bit of a byte on the line, in addition to its eight, that marks a wrong parity.
pub const WRONG_PARITY: u16 = 1 << 8;

/// Bytes between the port and the line.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Bytes to the chip, without gaps between them.
    pub to_chip: VecDeque<u16>,
    /// Bytes from the chip, each with the time of its end, ticks.
    pub from_chip: Vec<(u64, u8)>,
}

impl Line {
    /// Returns the bytes from the chip since the last call.
    pub fn take(&mut self) -> Vec<u8> {
        self.from_chip.drain(..).map(|(_, byte)| byte).collect()
    }
}

defaults! {
    /// A port; by default LPUART1.
    #[derive(Clone, Debug)]
    pub struct Uart {
        kind: &'static Kind = &LPUART1,
        store: Store = Store::of(LPUART1.name),
        /// ISR without the flags that follow from the FIFOs.
        status: u32 = TC,
        received: VecDeque<u8>,
        to_send: VecDeque<u8>,
        shifting: Option<u8>,
        sent_at: u64 = NEVER,
        arrives_at: u64 = NEVER,
        silent_at: u64 = NEVER,
        /// The line at its other end.
        pub line: Line,
    }
}

impl Uart {
    /// Makes a port after a reset.
    pub fn new(kind: &'static Kind) -> Self {
        Self { kind, store: Store::of(kind.name), ..Self::default() }
    }

    fn on(&self, which: u32) -> bool {
        self.store.get(CR1) & (UE | which) == UE | which
    }

    /// Returns the number of bytes that receiver and transmitter hold besides their shift registers.
    fn depth(&self) -> usize {
        if self.store.get(CR1) & FIFOEN != 0 { FIFO } else { 1 }
    }

    /// Returns ISR without the acknowledge flags.
    fn flags(&self) -> u32 {
        let rxne = if self.received.is_empty() { 0 } else { RXNE };
        let txe = if self.to_send.len() < self.depth() { TXE } else { 0 };
        let txfe = if self.depth() == FIFO && self.to_send.is_empty() { TXFE } else { 0 };
        self.status | rxne | txe | txfe
    }

    /// Returns the duration of some bits, ticks.
    fn bits(&self, count: u64) -> u64 {
        count * u64::from(self.store.get(BRR).max(self.kind.least)) / self.kind.units
    }

    /// Returns the duration of a byte, ticks: start bit, data with parity, stop bits.
    pub fn byte(&self) -> u64 {
        let parity = u64::from(self.store.get(CR1) & M0 != 0);
        let stops = if self.store.get(CR2) & 3 << 12 == TWO_STOPS { 2 } else { 1 };
        self.bits(9 + parity + stops)
    }

    /// Processes new bytes on the line.
    pub fn wake(&mut self, now: u64) {
        if self.arrives_at == NEVER && !self.line.to_chip.is_empty() {
            self.arrives_at = now + self.byte();
            self.silent_at = NEVER;
        }
    }

    /// Returns the time at which a byte has arrived or left, or the line was idle for long enough.
    pub fn next_event(&self) -> u64 {
        self.sent_at.min(self.arrives_at).min(self.silent_at)
    }

    /// Lets bytes arrive and leave. `driver` tells whether the transceiver drives the line and does not listen; without
    /// a transceiver the port does both. Returns whether a byte was lost because the transceiver does not drive the
    /// line.
    pub fn happen(&mut self, now: u64, driver: Option<bool>) -> bool {
        if self.arrives_at <= now {
            self.arrives_at = NEVER;
            if let Some(byte) = self.line.to_chip.pop_front()
                && self.on(RE)
                && driver != Some(true)
            {
                self.arrive(byte, now);
            }
            self.wake(now);
        }
        if self.silent_at <= now {
            self.silent_at = NEVER;
            self.status |= RTOF;
        }
        let mut lost = false;
        if self.sent_at <= now {
            let byte = self.shifting.take().map(|byte| (self.sent_at, byte));
            self.sent_at = NEVER;
            lost = byte.is_some() && driver == Some(false);
            self.line.from_chip.extend(byte.filter(|_| !lost));
            self.shift(now);
        }
        lost
    }

    fn arrive(&mut self, byte: u16, now: u64) {
        if self.received.len() >= self.depth() {
            self.status |= ORE;
        } else {
            self.received.push_back(byte as u8);
        }
        if byte & WRONG_PARITY != 0 && self.store.get(CR1) & PCE != 0 {
            self.status |= PE;
        }
        if self.store.get(CR2) & RTOEN != 0 {
            self.silent_at = now + self.bits(u64::from(self.store.get(RTOR) & 0xff_ffff));
        }
    }

    fn shift(&mut self, now: u64) {
        if self.shifting.is_some() {
            return;
        }
        self.shifting = self.to_send.pop_front();
        if self.shifting.is_some() {
            self.status &= !TC;
            self.sent_at = now + self.byte();
        } else {
            self.status |= TC;
        }
    }

    /// Whether any enabled event requests the interrupt.
    pub fn requests(&self) -> bool {
        let (cr1, cr3) = (self.store.get(CR1), self.store.get(CR3));
        let mut asked = cr1 & (RXNE | TC | TXE);
        for (enabled, flags) in [
            (cr1 & RXNE, ORE),
            (cr1 & PEIE, PE),
            (cr1 & RTOIE, RTOF),
            (cr1 & TXFEIE, TXFE),
            // EIE.
            (cr3 & 1, FE | NE | ORE),
        ] {
            asked |= if enabled != 0 { flags } else { 0 };
        }
        cr1 & UE != 0 && self.flags() & asked != 0
    }

    /// Reads a register, with its side effects.
    pub fn read(&mut self, offset: u32) -> Option<u32> {
        match offset {
            // REACK and TEACK follow RE and TE.
            ISR => Some(self.flags() | self.store.get(CR1) << 18 & 3 << 21),
            RDR => Some(u32::from(self.received.pop_front().unwrap_or_default())),
            _ => self.store.read(offset),
        }
    }

    /// Writes a register. A write that the port accepts only while it is off is not modelled.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        let changed = self.store.get(offset) ^ value;
        match offset {
            CR1 if self.on(0) && value & UE != 0 && changed & FIXED != 0 => return None,
            BRR | CR2 if self.on(0) && changed != 0 => return None,
            CR1 if value & UE == 0 => {
                self.store.write(offset, value)?;
                let (store, line) = (self.store.clone(), std::mem::take(&mut self.line));
                *self = Self { store, line, ..Self::new(self.kind) };
                self.wake(now);
            }
            ICR => self.status &= !(value & (PE | FE | NE | ORE | TC | RTOF)),
            TDR if self.on(TE) => {
                if self.to_send.len() < self.depth() {
                    self.to_send.push_back(value as u8);
                } else if let Some(last) = self.to_send.back_mut() {
                    *last = value as u8;
                }
                self.status &= !TC;
                self.shift(now);
            }
            TDR => {}
            _ => return self.store.write(offset, value).map(|_| Effect::Look),
        }
        Some(Effect::Look)
    }
}
