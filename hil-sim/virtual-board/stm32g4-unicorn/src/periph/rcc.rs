//! Clocks and resets (RM0440, section 7). Oscillators and PLL are ready as soon as they are on, except for a dead
//! crystal.

use super::{Effect, NEVER, Reset, Store, bits, offsets};

/// Ticks per second.
pub const TICKS_PER_S: u64 = 170_000_000;

offsets! {
    CR = 0x00, CFGR = 0x08, PLLCFGR = 0x0c, CIFR = 0x1c, CICR = 0x20, AHB1ENR = 0x48, AHB2ENR = 0x4c, APB1ENR1 = 0x58,
    APB1ENR2 = 0x5c, APB2ENR = 0x60, CCIPR = 0x88, CSR = 0x94, CRRCR = 0x98
}

// CR, CIFR.
bits! { HSION = 8, HSEON = 16, CSSON = 19 }
bits! { CSSF = 8 }
// Flags of resets in CSR: reset pin, power, software, watchdogs.
bits! { PIN = 26, BOR = 27, SFT = 28, IWDG = 29, WWDG = 30 }
const FLAGS: u32 = 0xfe00_0000;

/// Time at which clocks of peripherals were switched on.
#[derive(Clone, Copy, Debug, Default)]
pub struct On {
    /// Time, ticks.
    pub at: u64,
    /// Number of accesses to registers until then.
    pub accesses: u64,
}

defaults! {
    /// The clocks; by default after power-up.
    #[derive(Clone, Debug)]
    pub struct Rcc {
        store: Store = Store::of("RCC"),
        /// Flags of resets, which stay set until they are cleared.
        pub flags: u32 = BOR | PIN,
        cifr: u32,
        /// Frequency of the crystal, Hz; by default that of ST's Nucleo boards.
        pub crystal_hz: u32 = 24_000_000,
        /// Whether the crystal oscillates when it is on.
        pub crystal_lives: bool = true,
        /// Whether the PLL locks when it is on.
        pub pll_locks: bool = true,
        failed: bool,
        /// The last clocks that each enable register has switched on: their bits, and the time.
        on: [(u32, On); 7],
        /// Ticks of 170 MHz per cycle of the core.
        pub ticks_per_cycle: u64 = HSI_TICKS,
    }
}

/// Returns the flags of a reset.
pub fn flags_of(cause: Reset) -> u32 {
    PIN | match cause {
        Reset::Power => BOR,
        Reset::Pin => 0,
        Reset::Software => SFT,
        Reset::Watchdog => IWDG,
        Reset::Window => WWDG,
    }
}

impl Rcc {
    /// Returns the system clock, Hz.
    pub fn system_hz(&self) -> u64 {
        let oscillator = |select| if select == 3 { self.crystal_hz } else { HSI_HZ };
        u64::from(match self.store.get(CFGR) & 3 {
            3 => {
                let pll = self.store.get(PLLCFGR);
                let (m, n, r) = ((pll >> 4 & 15) + 1, pll >> 8 & 0x7f, 2 * ((pll >> 25 & 3) + 1));
                oscillator(pll & 3) / m * n / r
            }
            2 => self.crystal_hz,
            _ => HSI_HZ,
        })
    }

    /// Returns the clock of the core and its bus, Hz.
    pub fn bus_hz(&self) -> u64 {
        // HPRE: 8 is a division by two; there is no division by 32.
        const DIVIDERS: [u64; 8] = [2, 4, 8, 16, 64, 128, 256, 512];
        let divider = self.store.get(CFGR) >> 4 & 15;
        self.system_hz() / if divider < 8 { 1 } else { DIVIDERS[divider as usize - 8] }
    }

    /// Returns the time at which the clock of a peripheral was switched on, if it is on; it is unknown for all clocks
    /// of a register but the last.
    pub fn clock(&self, register: u32, bit: u32) -> Option<Option<On>> {
        if self.store.get(register) >> bit & 1 == 0 {
            return None;
        }
        let (bits, on) = self.on[place(register)];
        Some((bits >> bit & 1 != 0).then_some(on))
    }

    /// Whether the LSI oscillator is on.
    pub fn lsi_on(&self) -> bool {
        self.store.get(CSR) & 1 != 0
    }

    /// Whether MCO gives HSI divided by 16.
    pub fn hsi_on_mco(&self) -> bool {
        self.store.get(CFGR) >> 24 == 0x43 && self.store.get(CR) & HSION != 0
    }

    /// Whether the crystal is the source of the PLL.
    pub fn on_crystal(&self) -> bool {
        self.store.get(PLLCFGR) & 3 == 3
    }

    /// Whether ADC1 and ADC2 have a clock of their own.
    pub fn adc_kernel_clock(&self) -> bool {
        self.store.get(CCIPR) >> 28 & 3 != 0
    }

    /// Returns the time at which a failed crystal is detected.
    pub fn next_event(&self) -> u64 {
        let watched = self.store.get(CR) & (HSEON | CSSON) == HSEON | CSSON;
        if watched && !self.crystal_lives && !self.failed { 0 } else { NEVER }
    }

    /// Whether a failure of the crystal was detected, which acts on the break of TIM1 and raises an NMI.
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
                // Ready flags follow their enable bits: HSI, HSE, PLL.
                let hse = if self.crystal_lives { value & HSEON } else { 0 };
                value & !(1 << 10 | 1 << 17 | 1 << 25)
                    | (value & 1 << 8) << 2
                    | hse << 1
                    | (value & u32::from(self.pll_locks) << 24) << 1
            }
            CFGR => value & !0xc | (value & 3) << 2,
            CIFR => self.cifr,
            CSR => value & 1 | (value & 1) << 1 | self.flags,
            CRRCR => value | (value & 1) << 1,
            _ => value,
        })
    }

    /// Writes a register.
    pub fn write(&mut self, offset: u32, value: u32, on: On) -> Option<Effect> {
        match offset {
            CICR => {
                self.cifr &= !value;
                return Some(Effect::None);
            }
            CSR if value & 1 << 23 != 0 => self.flags &= !FLAGS,
            _ => {}
        }
        let before = self.store.read(offset)?;
        self.store.write(offset, value)?;
        if (AHB1ENR..=APB2ENR).contains(&offset) && value & !before != 0 {
            self.on[place(offset)] = (value & !before, on);
        }
        self.ticks_per_cycle = TICKS_PER_S.div_ceil(self.bus_hz());
        Some(Effect::Look)
    }
}

/// Returns the index of an enable register.
fn place(register: u32) -> usize {
    ((register - AHB1ENR) / 4) as usize
}

/// Frequency of the internal oscillator, Hz (datasheet).
pub const HSI_HZ: u32 = 16_000_000;
/// A cycle of it in ticks of 170 MHz, rounded.
pub const HSI_TICKS: u64 = 11;
