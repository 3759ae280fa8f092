//! The bus: reads and writes of registers, each passed to the model of its peripheral.

use thiserror::Error;

use super::{Chip, Circuit, OWN_REFERENCE_CODE, pins};
use crate::memory;
use crate::periph::rcc::{AHB1ENR, AHB2ENR, APB1ENR1, APB1ENR2, APB2ENR, On};
use crate::periph::{Effect, Reset, gpio::IDR, kept, uart};

/// The peripherals whose clock can be off, one per row: name, first address, enable register and bit. The names become constants.
macro_rules! clocked {
    ($($name:ident = $first:literal, $register:ident, $bit:literal;)*) => {
        $(const $name: u32 = $first;)*

        /// Returns name, enable register and bit of the clock for an address; `None` if it has no clock of its own.
        pub fn clock_of(address: u32) -> Option<(&'static str, u32, u32)> {
            match address & !0x3ff {
                $($name => Some((stringify!($name), $register, $bit)),)*
                _ => None,
            }
        }
    };
}

clocked! {
    TIM1 = 0x4001_2c00, APB2ENR, 11;
    ADC12 = 0x5000_0000, AHB2ENR, 13;
    ADC345 = 0x5000_0400, AHB2ENR, 14;
    TIM8 = 0x4001_3400, APB2ENR, 13;
    TIM2 = 0x4000_0000, APB1ENR1, 0;
    TIM5 = 0x4000_0c00, APB1ENR1, 3;
    TIM16 = 0x4001_4400, APB2ENR, 17;
    WWDG = 0x4000_2c00, APB1ENR1, 11;
    GPIOA = 0x4800_0000, AHB2ENR, 0;
    GPIOB = 0x4800_0400, AHB2ENR, 1;
    GPIOC = 0x4800_0800, AHB2ENR, 2;
    GPIOD = 0x4800_0c00, AHB2ENR, 3;
    GPIOE = 0x4800_1000, AHB2ENR, 4;
    GPIOF = 0x4800_1400, AHB2ENR, 5;
    GPIOG = 0x4800_1800, AHB2ENR, 6;
    PWR = 0x4000_7000, APB1ENR1, 28;
    LPUART1 = 0x4000_8000, APB1ENR2, 0;
    USART3 = 0x4000_4800, APB1ENR1, 18;
    SYSCFG = 0x4001_0000, APB2ENR, 0;
    DAC1 = 0x5000_0800, AHB2ENR, 16;
    DAC3 = 0x5000_1000, AHB2ENR, 18;
    FLASH = 0x4002_2000, AHB1ENR, 8;
    CRC = 0x4002_3000, AHB1ENR, 12;
    TAMP = 0x4000_2400, APB1ENR1, 10;
}
const EXTI: u32 = 0x4001_0400;
const IWDG: u32 = 0x4000_3000;
const RCC: u32 = 0x4002_1000;
/// Address of the factory calibration; the counts of the chip's internal reference are at its offset 0x1aa (datasheet, VREFINT_CAL).
const FACTORY: u32 = 0x1fff_7400;
const DBGMCU: u32 = 0xe004_2000;
/// First address of the registers of the core.
const CORE: u32 = 0xe000_0000;
const BDTR: u32 = TIM1 + 0x44;
/// Compare values of the first three channels.
const COMPARES: std::ops::Range<u32> = TIM1 + 0x34..TIM1 + 0x40;
const TIM1_SR: u32 = 0x10;

/// Returns the addresses of all registers whose value the model keeps, with their writable bits.
pub fn kept_registers() -> impl Iterator<Item = (u32, u32)> {
    const PORTS: &[u32] = &[GPIOA, GPIOB, GPIOC, GPIOD, GPIOE, GPIOF, GPIOG];
    let adcs = &[ADC12, ADC12 + 0x100, ADC345, ADC345 + 0x100];
    [
        ("RCC", &[RCC] as &[u32]),
        ("PWR", &[PWR]),
        ("FLASH", &[FLASH]),
        ("SYSCFG", &[SYSCFG]),
        ("EXTI", &[EXTI]),
        ("SCS", &[0]),
        ("GPIO", PORTS),
        ("TIM1", &[TIM1]),
        ("TIM2", &[TIM2]),
        ("TIM5", &[TIM5]),
        ("TIM16", &[TIM16]),
        ("TIM8", &[TIM8]),
        ("ADC", adcs),
        ("DAC", &[DAC1, DAC3]),
        ("LPUART1", &[LPUART1]),
        ("USART3", &[USART3]),
        ("WWDG", &[WWDG]),
    ]
    .into_iter()
    .flat_map(|(name, bases)| bases.iter().flat_map(move |base| kept(name, *base)))
}

/// An access that the model does not know.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("unknown register {address:#010x} {}", written.map_or("read".into(), |value| format!("written with {value:#x}")))]
pub struct Unknown {
    /// Address of the access.
    pub address: u32,
    /// The value to be written, for a write.
    pub written: Option<u32>,
    /// Last known position of the core: the instruction, or in CCM the block.
    pub at: u32,
}

impl<C: Circuit> Chip<C> {
    /// Reads `size` bytes of a register.
    pub fn read(&mut self, address: u32, size: u8) -> u32 {
        self.begin_access();
        let value = if let Some((word, bit)) = bit_band(address) {
            self.peek(word).map(|value| value >> bit & 1)
        } else {
            self.read_word(address & !3).map(|value| value >> (8 * (address & 3)))
        };
        value.map_or_else(|| self.is_unknown(address, None), |value| value & mask(size))
    }

    /// Writes `size` bytes to a register.
    pub fn write(&mut self, address: u32, size: u8, value: u32) {
        self.begin_access();
        let alias = bit_band(address);
        let done = if alias.is_none() && size >= 4 {
            self.write_word(address, value)
        } else {
            let (word, shift) = alias.unwrap_or((address & !3, 8 * (address & 3)));
            let mask = if alias.is_some() { 1 } else { mask(size) } << shift;
            let old = self.peek(word);
            old.and_then(|old| self.write_word(word, old & !mask | value << shift & mask))
        };
        if COMPARES.contains(&address) {
            self.compared = (self.blocks.len(), self.accesses);
        }
        if done.is_none() {
            self.is_unknown(address, Some(value));
        }
    }

    fn begin_access(&mut self) {
        self.accesses += 1;
        (self.rules.now, self.rules.at) = (self.now, self.at);
    }

    fn is_unknown(&mut self, address: u32, written: Option<u32>) -> u32 {
        if self.forgiving {
            return 0;
        }
        self.unknown.get_or_insert(Unknown { address, written, at: self.at });
        self.attention = true;
        0
    }

    /// Returns the value of a register, without the side effects of a read.
    fn peek(&mut self, address: u32) -> Option<u32> {
        match address & !0x3ff {
            IWDG | LPUART1 | USART3 => Some(0),
            _ => self.read_word(address),
        }
    }

    fn read_word(&mut self, address: u32) -> Option<u32> {
        // A peripheral without its clock reads as after a reset.
        let clocked = self.is_clocked(address);
        if clocked { self.read_clocked(address) } else { Self::default().read_clocked(address) }
    }

    /// Reads a register of a peripheral whose clock is on, or of one without a clock of its own.
    pub(super) fn read_clocked(&mut self, address: u32) -> Option<u32> {
        let (offset, now) = (address & 0x3ff, self.now);
        match address & !0x3ff {
            TIM1 => self.tim1.read(offset, now),
            ADC12 => self.adc.read(offset, now),
            ADC345 => self.slow_adc.read(offset, now),
            TIM2 => self.tim2.read(offset),
            TIM8 => self.tim8.0.read(offset),
            TIM5 => self.tim5.read(offset, now, self.rcc.lsi_on()),
            TIM16 => self.tim16.read(offset, now, self.rcc.hsi_on_mco()),
            FACTORY if offset == 0x1a8 => Some(u32::from(OWN_REFERENCE_CODE) << 16),
            RCC => self.rcc.read(offset),
            PWR => self.pwr.read(offset),
            FLASH => self.flash.read(offset, now),
            CRC => self.crc.read(offset),
            TAMP => self.tamp.read(offset),
            port @ (LPUART1 | USART3) => {
                let port = if port == LPUART1 { &mut self.lpuart } else { &mut self.usart3 };
                let value = port.read(offset);
                self.update_lines();
                value
            }
            IWDG => self.iwdg.read(offset, now),
            WWDG => self.wwdg.read(offset, now),
            SYSCFG => match offset {
                0x200..0x220 => Some(self.comp.get((offset - 0x200) as usize / 4)?.read()),
                _ => self.syscfg.read(offset),
            },
            EXTI => self.exti.read(offset),
            GPIOA..=GPIOG => {
                let port = port(address);
                let wires =
                    if offset == IDR { (self.grounded[port], self.lifted[port]) } else { (0, 0) };
                Some(self.gpio[port].read(offset)? & !wires.0 | wires.1)
            }
            DAC1 => self.dac[0].read(offset, now),
            DAC3 => self.dac[1].read(offset, now),
            memory::STORED..memory::FLASH_END => {
                self.fetch(address, 4);
                let (value, torn) = self.flash.load(address);
                if torn {
                    self.flash_error();
                }
                Some(value)
            }
            DBGMCU => self.debug.read(offset),
            CORE.. => self.scs.read(address, now),
            _ => None,
        }
    }

    fn write_word(&mut self, address: u32, value: u32) -> Option<()> {
        if !self.is_clocked(address) {
            return Some(());
        }
        let (offset, now) = (address & 0x3ff, self.now);
        let locked = self.monitor_is_locked();
        let rules = &mut self.rules;
        let effect = match address & !0x3ff {
            TIM1 => self.tim1.write(offset, value, rules)?,
            ADC12 => self.adc.write(offset, value, rules)?,
            ADC345 => self.slow_adc.write(offset, value, rules)?,
            TIM2 => self.tim2.write(offset, value)?,
            TIM8 => self.tim8.0.write(offset, value)?,
            TIM5 => self.tim5.write(offset, value, now)?,
            TIM16 => self.tim16.write(offset, value, now)?,
            RCC => self.rcc.write(offset, value, On { at: now, accesses: self.accesses })?,
            PWR => self.pwr.write(offset, value, locked)?,
            FLASH => self.flash.write(offset, value, rules)?,
            CRC => self.crc.write(offset, value)?,
            TAMP if !self.pwr.opens_backup() => Effect::None,
            TAMP => self.tamp.write(offset, value)?,
            LPUART1 => self.lpuart.write(offset, value, now)?,
            USART3 => self.usart3.write(offset, value, now)?,
            IWDG => self.iwdg.write(offset, value, rules)?,
            WWDG => self.wwdg.write(offset, value, now)?,
            SYSCFG => match offset {
                0x200..0x220 => self.comp.get_mut((offset - 0x200) as usize / 4)?.write(value, now),
                _ => self.syscfg.write(offset, value)?,
            },
            EXTI => self.exti.write(offset, value)?,
            GPIOA..=GPIOG => self.gpio[port(address)].write(offset, value)?,
            DAC1 => self.dac[0].write(offset, value, rules)?,
            DAC3 => self.dac[1].write(offset, value, rules)?,
            memory::STORED..memory::FLASH_END => self.flash.store(address, value, now)?,
            DBGMCU => self.debug.write(offset, value)?,
            CORE.. => self.scs.write(address, value, now)?,
            _ => return None,
        };
        self.check_rules(address, value);
        if moves_pins(address) {
            self.follow_break_pin();
            self.follow_pins();
        }
        self.follow(effect)
    }

    /// Checks the rules that concern a write and other parts of the chip.
    fn check_rules(&mut self, address: u32, value: u32) {
        let offset = address & 0x3ff;
        match address & !0x3ff {
            TIM1 if address == BDTR && value & 1 << 15 != 0 && self.tim1.main_output() => {
                self.check_gate_pins();
            }
            TIM2 => self.check_encoder_pins(),
            LPUART1 if offset == uart::TDR => {
                self.require_pin(pins::SERIAL[0], "LPUART1_TDR is written");
            }
            USART3 if offset == uart::TDR => self.check_bus_pins(),
            ADC345 => self.check_beside(self.now),
            RCC | FLASH => {
                self.follow_hsi();
                self.adc.kernel_clock = self.rcc.adc_kernel_clock();
                self.scs.systick.cycle = self.rcc.ticks_per_cycle;
                self.check_clocks();
            }
            PWR => {
                self.check_clocks();
                self.monitor_supply();
            }
            SYSCFG if offset >= 0x200 => self.check_reference(offset),
            // A persistent break clears MOE again.
            SYSCFG | TIM8 => self.monitor_supply(),
            _ => {}
        }
    }

    fn follow(&mut self, effect: Effect) -> Option<()> {
        match effect {
            Effect::None => return Some(()),
            Effect::Look => self.update_lines(),
            Effect::Reset => self.reset = Some(Reset::Software),
        }
        self.attention = true;
        Some(())
    }
}

/// Whether a write may change levels at the pins. Compare values change them at the top of the counter, where the
/// circuit follows in any case.
fn moves_pins(address: u32) -> bool {
    match address & !0x3ff {
        TIM1 => !COMPARES.contains(&address) && address & 0x3ff != TIM1_SR,
        GPIOA..=GPIOG => true,
        _ => false,
    }
}

/// Returns the mask of an access of some bytes.
fn mask(size: u8) -> u32 {
    u32::MAX >> 32_u8.saturating_sub(8 * size)
}

fn port(address: u32) -> usize {
    ((address - GPIOA) >> 10) as usize
}

/// Returns the word and bit for an address of the bit-band alias.
fn bit_band(address: u32) -> Option<(u32, u32)> {
    let offset = address.checked_sub(memory::BIT_BAND).filter(|offset| *offset < 0x60_0000)?;
    Some((memory::PERIPHERALS + (offset >> 7 << 2), offset >> 2 & 31))
}
