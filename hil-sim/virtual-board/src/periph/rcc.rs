//! Clocks and resets (RM0440, section 7). Oscillators and PLL are ready as soon as they are on, but for
//! a crystal that is dead.

use super::{Effect, NEVER, Plain, Reset, Store};

const ALL: u32 = u32::MAX;
const CR: u32 = 0x00;
const CFGR: u32 = 0x08;
const CIFR: u32 = 0x1c;
const CICR: u32 = 0x20;
const CSR: u32 = 0x94;

const KNOWN: &[Plain] = &[
    (CR, 0x100, 0x010d_0b00),
    (0x04, 0x4000_0000, 0x7f00_0000),
    (CFGR, 0x5, 0x7f00_3ff3),
    (0x0c, 0x1000, ALL),
    (0x18, 0, ALL),
    (CIFR, 0, 0),
    (CICR, 0, 0),
    (0x28, 0, ALL),
    (0x2c, 0, ALL),
    (0x30, 0, ALL),
    (0x38, 0, ALL),
    (0x3c, 0, ALL),
    (0x40, 0, ALL),
    (0x48, 0x100, ALL),
    (0x4c, 0, ALL),
    (0x50, 0, ALL),
    (0x58, 0x400, ALL),
    (0x5c, 0, ALL),
    (0x60, 0, ALL),
    (0x88, 0, ALL),
    (0x90, 0, 0),
    (CSR, 0, 1),
    (0x98, 0, 1),
    (0x9c, 0, ALL),
];

const HSEON: u32 = 1 << 16;
const CSSON: u32 = 1 << 19;
const CSSF: u32 = 1 << 8;
/// Flags of resets in CSR: software, reset pin, power, watchdog.
const SFT: u32 = 1 << 28;
const PIN: u32 = 1 << 26;
const BOR: u32 = 1 << 27;
const IWDG: u32 = 1 << 29;
const FLAGS: u32 = 0xfe00_0000;

/// The clocks.
#[derive(Clone, Debug)]
pub struct Rcc {
    store: Store,
    flags: u32,
    cifr: u32,
    /// Whether the crystal oscillates when it is on.
    pub crystal_lives: bool,
    failed: bool,
    ticks_per_cycle: u64,
}

impl Rcc {
    /// After a reset.
    pub fn new(cause: Reset) -> Self {
        let flags = match cause {
            Reset::Power => BOR | PIN,
            Reset::Pin => PIN,
            Reset::Software => SFT | PIN,
            Reset::Watchdog => IWDG | PIN,
        };
        Self {
            store: Store::new(KNOWN),
            flags,
            cifr: 0,
            crystal_lives: true,
            failed: false,
            ticks_per_cycle: HSI_TICKS,
        }
    }

    /// Flags of earlier resets stay until they are cleared.
    pub fn add_reset_flags(&mut self, flags: u32) {
        self.flags |= flags;
    }

    /// The flags.
    pub fn reset_flags(&self) -> u32 {
        self.flags
    }

    /// Ticks of 170 MHz per cycle of the core.
    #[inline]
    pub fn ticks_per_cycle(&self) -> u64 {
        self.ticks_per_cycle
    }

    /// When a failed crystal is found.
    pub fn next_event(&self) -> u64 {
        let watched = self.store.get(CR) & (HSEON | CSSON) == HSEON | CSSON;
        if watched && !self.crystal_lives && !self.failed { 0 } else { NEVER }
    }

    /// Whether the crystal was found to have failed: to the break of TIM1, and an NMI.
    pub fn happen(&mut self, now: u64) -> bool {
        if now < self.next_event() {
            return false;
        }
        self.failed = true;
        self.cifr |= CSSF;
        // The core falls back to the internal oscillator.
        let cfgr = self.store.get(CFGR) & !3 | 1;
        self.store.write(CFGR, cfgr);
        self.ticks_per_cycle = HSI_TICKS;
        true
    }

    /// Reads a register.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let value = self.store.read(offset)?;
        Some(match offset {
            CR => {
                // Ready flags follow their switches: HSI, HSE, PLL.
                let hse = if self.crystal_lives { value & HSEON } else { 0 };
                value & !(1 << 10 | 1 << 17 | 1 << 25)
                    | (value & 1 << 8) << 2
                    | hse << 1
                    | (value & 1 << 24) << 1
            }
            CFGR => value & !0xc | (value & 3) << 2,
            CIFR => self.cifr,
            CSR => value & 1 | (value & 1) << 1 | self.flags,
            0x98 => value | (value & 1) << 1,
            _ => value,
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, _now: u64) -> Option<Effect> {
        match offset {
            CICR => {
                self.cifr &= !value;
                return Some(Effect::None);
            }
            CSR if value & 1 << 23 != 0 => self.flags &= !FLAGS,
            _ => {}
        }
        self.store.write(offset, value)?;
        if offset == CFGR {
            self.ticks_per_cycle = if value & 3 == 3 { 1 } else { HSI_TICKS };
        }
        Some(Effect::Look)
    }
}

/// A cycle of 16 MHz, in ticks of 170 MHz, rounded.
const HSI_TICKS: u64 = 11;
