//! LPUART1 (RM0440, section 38), 8N1, with or without its FIFOs; the wire to the console.

use std::collections::VecDeque;

use super::usart::{FE, FIFOEN, ORE, RE, RXNE, TC, TE, TXE, UE};
use super::{Effect, NEVER, Store, registers};

registers! {
    CR1 = 0x00, 0, 0xf3ff_7fff;
    _ = 0x04, 0, 0xff0f_b010;
    CR3 = 0x08, 0, 0xfef0_f7c9;
    BRR = 0x0c, 0, 0xf_ffff;
    _ = 0x18, 0, 0;
    ISR = 0x1c, 0, 0;
    ICR = 0x20, 0, 0;
    RDR = 0x24, 0, 0;
    TDR = 0x28, 0, 0;
    _ = 0x2c, 0, 0xf;
}

/// TXFE of ISR; RXFF is never asked for.
const TXFE: u32 = 1 << 23;
/// The enable of TXFE in CR1.
const TXFEIE: u32 = 1 << 30;
/// Bytes that a FIFO holds.
const FIFO: usize = 8;
/// Start bit, eight data bits, stop bit.
const BITS: u64 = 10;

/// Bytes between the port and the console.
#[derive(Clone, Debug, Default)]
pub struct Wire {
    /// To the chip.
    pub to_chip: VecDeque<u8>,
    /// From the chip.
    pub from_chip: Vec<u8>,
}

/// The port.
#[derive(Clone, Debug)]
pub struct Lpuart {
    store: Store,
    /// TC, FE and ORE; the others follow from the FIFOs.
    status: u32,
    received: VecDeque<u8>,
    to_send: VecDeque<u8>,
    shifting: Option<u8>,
    sent_at: u64,
    arrives_at: u64,
    /// Its other end.
    pub wire: Wire,
}

impl Default for Lpuart {
    fn default() -> Self {
        Self {
            store: Store::new(KNOWN),
            status: TC,
            received: VecDeque::new(),
            to_send: VecDeque::new(),
            shifting: None,
            sent_at: NEVER,
            arrives_at: NEVER,
            wire: Wire::default(),
        }
    }
}

impl Lpuart {
    fn on(&self, which: u32) -> bool {
        self.store.get(CR1) & (UE | which) == UE | which
    }

    /// Bytes that the receiver and the transmitter hold beside their shift registers.
    fn depth(&self) -> usize {
        if self.store.get(CR1) & FIFOEN != 0 { FIFO } else { 1 }
    }

    /// ISR but for the acknowledges.
    fn flags(&self) -> u32 {
        let rxne = if self.received.is_empty() { 0 } else { RXNE };
        let txe = if self.to_send.len() < self.depth() { TXE } else { 0 };
        let with_fifo = self.store.get(CR1) & FIFOEN != 0;
        let txfe = if with_fifo && self.to_send.is_empty() { TXFE } else { 0 };
        self.status | rxne | txe | txfe
    }

    /// Ticks per byte.
    fn byte(&self) -> u64 {
        BITS * u64::from(self.store.get(BRR).max(0x300)) / 256
    }

    /// A byte was put on the wire.
    pub fn wake(&mut self, now: u64) {
        if self.arrives_at == NEVER && !self.wire.to_chip.is_empty() {
            self.arrives_at = now + self.byte();
        }
    }

    /// When a byte has arrived or left.
    pub fn next_event(&self) -> u64 {
        self.sent_at.min(self.arrives_at)
    }

    /// Lets bytes arrive and leave.
    pub fn happen(&mut self, now: u64) {
        if self.arrives_at <= now {
            self.arrives_at = NEVER;
            if let Some(byte) = self.wire.to_chip.pop_front()
                && self.on(RE)
            {
                if self.received.len() >= self.depth() {
                    self.status |= ORE;
                } else {
                    self.received.push_back(byte);
                }
            }
            self.wake(now);
        }
        if self.sent_at <= now {
            self.sent_at = NEVER;
            self.wire.from_chip.extend(self.shifting.take());
            self.shift(now);
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

    /// Whether any enabled event asks for the interrupt.
    pub fn requests(&self) -> bool {
        let (cr1, cr3) = (self.store.get(CR1), self.store.get(CR3));
        let asked = cr1 & (RXNE | TC | TXE) | if cr1 & TXFEIE != 0 { TXFE } else { 0 };
        let errors =
            if cr3 & 1 != 0 { FE | ORE } else { 0 } | if cr1 & RXNE != 0 { ORE } else { 0 };
        cr1 & UE != 0 && self.flags() & (asked | errors) != 0
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

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Option<Effect> {
        match offset {
            // Changed only while the port is off.
            CR1 if self.on(0) && value & UE != 0 && (value ^ self.store.get(CR1)) & FIFOEN != 0 => {
                return None;
            }
            BRR if self.on(0) => return None,
            CR1 if value & UE == 0 => {
                self.store.write(offset, value)?;
                (self.received, self.to_send) = (VecDeque::new(), VecDeque::new());
            }
            ICR => self.status &= !(value & (FE | ORE | 1 | 1 << 2)),
            TDR => {
                if self.on(TE) {
                    if self.to_send.len() < self.depth() {
                        self.to_send.push_back(value as u8);
                    } else if let Some(last) = self.to_send.back_mut() {
                        *last = value as u8;
                    }
                    self.status &= !TC;
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
