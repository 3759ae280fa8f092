//! USART3 (RM0440, section 37) without its FIFOs, and the RS-485 line behind its transceiver.

use std::collections::VecDeque;

use super::{Effect, NEVER, Store, registers};

registers! {
    CR1 = 0x00, 0, 0xdfff_ffff;
    CR2 = 0x04, 0, 0xffff_ff79;
    CR3 = 0x08, 0, 0xfffe_ffff;
    BRR = 0x0c, 0, 0xffff;
    _ = 0x10, 0, 0xffff;
    RTOR = 0x14, 0, u32::MAX;
    _ = 0x18, 0, 0;
    ISR = 0x1c, 0, 0;
    ICR = 0x20, 0, 0;
    RDR = 0x24, 0, 0;
    TDR = 0x28, 0, 0;
    _ = 0x2c, 0, 0xf;
}

/// Offset of the register that sends.
pub const SEND: u32 = TDR;

/// Bits of CR1 and ISR that LPUART1 has as well are used by both.
pub(super) const UE: u32 = 1;
pub(super) const RE: u32 = 1 << 2;
pub(super) const TE: u32 = 1 << 3;
const PCE: u32 = 1 << 10;
const M0: u32 = 1 << 12;
const RTOIE: u32 = 1 << 26;
pub(super) const FIFOEN: u32 = 1 << 29;
/// Bits of CR1 that can be changed only while the port is off: OVER8, M1, M0, WAKE, PCE, PS.
const FIXED: u32 = 1 << 28 | 1 << 15 | M0 | 1 << 11 | PCE | 1 << 9;
const TWO_STOPS: u32 = 2 << 12;
const RTOEN: u32 = 1 << 23;
const PE: u32 = 1;
pub(super) const FE: u32 = 1 << 1;
const NE: u32 = 1 << 2;
pub(super) const ORE: u32 = 1 << 3;
pub(super) const RXNE: u32 = 1 << 5;
pub(super) const TC: u32 = 1 << 6;
pub(super) const TXE: u32 = 1 << 7;
const RTOF: u32 = 1 << 11;
/// PEIE of CR1 asks for PE.
const PEIE: u32 = 1 << 8;

/// A byte of the line whose parity is wrong has this bit beside its eight.
pub const WRONG_PARITY: u16 = 1 << 8;

/// Bytes between the port and the line.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// To the chip, without gaps between them.
    pub to_chip: VecDeque<u16>,
    /// From the chip, each with the time of its end, ticks.
    pub from_chip: Vec<(u64, u8)>,
}

/// The port.
#[derive(Clone, Debug)]
pub struct Usart {
    store: Store,
    status: u32,
    received: u8,
    to_send: Option<u8>,
    shifting: Option<u8>,
    sent_at: u64,
    arrives_at: u64,
    silent_at: u64,
    /// Its other end.
    pub line: Line,
}

impl Default for Usart {
    fn default() -> Self {
        Self {
            store: Store::new(KNOWN),
            status: TXE | TC,
            received: 0,
            to_send: None,
            shifting: None,
            sent_at: NEVER,
            arrives_at: NEVER,
            silent_at: NEVER,
            line: Line::default(),
        }
    }
}

impl Usart {
    fn on(&self, which: u32) -> bool {
        self.store.get(CR1) & (UE | which) == UE | which
    }

    /// Ticks of a bit.
    fn bit(&self) -> u64 {
        u64::from(self.store.get(BRR).max(16))
    }

    /// Ticks of a byte: start bit, data with parity, stop bits.
    pub fn byte(&self) -> u64 {
        let parity = u64::from(self.store.get(CR1) & M0 != 0);
        let stops = if self.store.get(CR2) & 3 << 12 == TWO_STOPS { 2 } else { 1 };
        self.bit() * (9 + parity + stops)
    }

    /// Bytes were put on the line.
    pub fn wake(&mut self, now: u64) {
        if self.arrives_at == NEVER && !self.line.to_chip.is_empty() {
            self.arrives_at = now + self.byte();
            self.silent_at = NEVER;
        }
    }

    /// When a byte has arrived or left, or the line was silent for long enough.
    pub fn next_event(&self) -> u64 {
        self.sent_at.min(self.arrives_at).min(self.silent_at)
    }

    /// Lets bytes arrive and leave. `driver`: whether the transceiver drives the line, and does not listen. Whether a byte
    /// was lost because it does not.
    pub fn happen(&mut self, now: u64, driver: bool) -> bool {
        if self.arrives_at <= now {
            self.arrives_at = NEVER;
            if let Some(byte) = self.line.to_chip.pop_front()
                && self.on(RE)
                && !driver
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
            lost = byte.is_some() && !driver;
            self.line.from_chip.extend(byte.filter(|_| driver));
            self.shift(now);
        }
        lost
    }

    fn arrive(&mut self, byte: u16, now: u64) {
        if self.status & RXNE != 0 {
            self.status |= ORE;
        } else {
            self.status |= RXNE;
            self.received = byte as u8;
        }
        if byte & WRONG_PARITY != 0 && self.store.get(CR1) & PCE != 0 {
            self.status |= PE;
        }
        if self.store.get(CR2) & RTOEN != 0 {
            self.silent_at = now + self.bit() * u64::from(self.store.get(RTOR) & 0xff_ffff);
        }
    }

    fn shift(&mut self, now: u64) {
        if self.shifting.is_some() {
            return;
        }
        self.shifting = self.to_send.take();
        if self.shifting.is_some() {
            self.status = self.status & !TC | TXE;
            self.sent_at = now + self.byte();
        } else {
            self.status |= TC;
        }
    }

    /// Whether any enabled event asks for the interrupt.
    pub fn requests(&self) -> bool {
        let (cr1, cr3) = (self.store.get(CR1), self.store.get(CR3));
        let mut asked = cr1 & (RXNE | TC | TXE);
        for (enabled, flags) in [
            (cr1 & RXNE, ORE),
            (cr1 & PEIE, PE),
            (cr1 & RTOIE, RTOF),
            // EIE.
            (cr3 & 1, FE | NE | ORE),
        ] {
            asked |= if enabled != 0 { flags } else { 0 };
        }
        cr1 & UE != 0 && self.status & asked != 0
    }

    /// Reads a register, with its side effects.
    pub fn read(&mut self, offset: u32) -> Option<u32> {
        match offset {
            // REACK and TEACK follow RE and TE.
            ISR => Some(self.status | self.store.get(CR1) << 18 & 3 << 21),
            RDR => {
                self.status &= !RXNE;
                Some(u32::from(self.received))
            }
            _ => self.store.read(offset),
        }
    }

    /// Writes a register. Unknown is what the port takes only while it is off.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        let changed = self.store.get(offset) ^ value;
        match offset {
            CR1 if value & FIFOEN != 0 => return None,
            CR1 if self.on(0) && value & UE != 0 && changed & FIXED != 0 => return None,
            BRR | CR2 if self.on(0) && changed != 0 => return None,
            CR1 if value & UE == 0 => {
                self.store.write(offset, value)?;
                let (store, line) = (self.store.clone(), std::mem::take(&mut self.line));
                *self = Self { store, line, ..Self::default() };
                self.wake(now);
            }
            ICR => self.status &= !(value & (PE | FE | NE | ORE | TC | RTOF)),
            TDR => {
                if self.on(TE) {
                    self.to_send = Some(value as u8);
                    self.status &= !(TXE | TC);
                    self.shift(now);
                }
            }
            _ => {
                self.store.write(offset, value)?;
            }
        }
        Some(Effect::Look)
    }
}
