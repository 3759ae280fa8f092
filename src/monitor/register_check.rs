//! Check of the chip's configuration for flipped bits, a slice in each pass of the main loop.
//!
//! The lock of TIM1 protects dead time, polarity and break from a program, not from a disturbance, and it does not cover the divider of
//! the dead time's clock (CKD). The values after the start, which reads its settings back, are the reference. Of each, the exclusive or of
//! its halves is kept: a flipped bit flips one of these 16 bits.

use super::record::{Reason, Record};
use crate::board;

/// Registers read in a pass of the main loop.
const SLICE: usize = 8;

/// A register and its bits that do not change from the start to the next reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Address.
    pub address: u32,
    /// Bits.
    pub mask: u32,
}

/// Direction of a counter.
const DIR: u32 = 1 << 4;
/// Main output enable.
const MOE: u32 = 1 << 15;
/// ADC: enabled, started, its regulator on, not in deep power-down.
const ADC_RUNS: u32 = 1 | 1 << 3 | 1 << 28 | 1 << 29;

/// Addresses of peripherals, with the offsets of their registers (RM0440).
const CONFIGURED: [(u32, &[u16]); 25] = [
    // TIM1: CR1, CR2, SMCR, DIER, CCMR1, CCMR2, CCER, PSC, ARR, RCR, CCR4, BDTR, CCR5, CCR6, CCMR3, DTR2, TISEL,
    // AF1, AF2
    (0x4001_2c00, &[0, 4, 8, 0xc, 0x18, 0x1c, 0x20, 0x28, 0x2c, 0x30, 0x40, 0x44]),
    (0x4001_2c00, &[0x48, 0x4c, 0x50, 0x54, 0x5c, 0x60, 0x64]),
    // TIM8: CR1, CCMR1, CCER, ARR, BDTR, AF1
    (0x4001_3400, &[0, 0x18, 0x20, 0x2c, 0x44, 0x60]),
    // TIM5, the time base, and TIM16, which captures the HSI: CR1, CCMR1, CCER, ARR, TISEL
    (0x4000_0c00, &[0, 0x18, 0x20, 0x2c, 0x5c]),
    (0x4001_4400, &[0, 0x18, 0x20, 0x2c, 0x5c]),
    // TIM2, the encoder: CR1, SMCR, CCMR1, CCER, ARR, TISEL, AF1
    (0x4000_0000, &[0, 8, 0x18, 0x20, 0x2c, 0x5c, 0x60]),
    // ADC1 and ADC2: IER, CR, CFGR, CFGR2, SMPR1, SMPR2 of ADC1, TR1, SQR1, JSQR, DIFSEL, CALFACT; CCR of both
    (0x5000_0000, &[4, 8, 0xc, 0x10, 0x14, 0x18, 0x20, 0x30, 0x4c, 0xb0, 0xb4]),
    (0x5000_0100, &[4, 8, 0xc, 0x10, 0x14, 0x20, 0x30, 0x4c, 0xb0, 0xb4]),
    (0x5000_0300, &[8]),
    // ADC3 and ADC4: CR, CFGR, CFGR2, SMPR1, JSQR; CCR of both
    (0x5000_0400, &[8, 0xc, 0x10, 0x14, 0x4c]),
    (0x5000_0500, &[8, 0xc, 0x10, 0x14, 0x4c]),
    (0x5000_0700, &[8]),
    // DAC3: CR, DHR12R1, MCR
    (0x5000_1000, &[0, 8, 0x3c]),
    // The comparator: CSR
    (board::COMPARATOR_CSR, &[0]),
    // SYSCFG: MEMRMP, CFGR2, SWPR
    (0x4001_0000, &[0, 0x1c, 0x20]),
    // Ports A, B, C: MODER, OTYPER, OSPEEDR, PUPDR, AFRL, AFRH
    (0x4800_0000, &[0, 4, 8, 0xc, 0x20, 0x24]),
    (0x4800_0400, &[0, 4, 8, 0xc, 0x20, 0x24]),
    (0x4800_0800, &[0, 4, 8, 0xc, 0x20, 0x24]),
    // The window watchdog: CFR
    (0x4000_2c00, &[4]),
    // Core: VTOR, AIRCR, CPACR, MPU_CTRL, MPU_RBAR and MPU_RASR of the guard, FPCCR, FPDSCR
    (0xe000_ed00, &[8, 0xc, 0x88, 0x94, 0x9c, 0xa0, 0x234, 0x23c]),
    // NVIC: enabled interrupts 0 to 95; priorities of ADC1_2, USART3, LPUART
    (0xe000_e000, &[0x100, 0x104, 0x108, 0x410, 0x424, 0x458]),
    // FLASH: ACR
    (0x4002_2000, &[0]),
    // RCC: CR, CFGR, PLLCFGR, AHB1ENR, AHB2ENR, APB1ENR1, APB1ENR2, APB2ENR, the same while the core sleeps, CCIPR, CSR
    (0x4002_1000, &[0, 8, 0xc, 0x48, 0x4c, 0x58, 0x5c, 0x60]),
    (0x4002_1000, &[0x68, 0x6c, 0x78, 0x7c, 0x80, 0x88, 0x94]),
    // PWR: CR1, CR2, CR5
    (0x4000_7000, &[0, 4, 0x80]),
];

/// The bits that do not change, for registers that hold others as well.
const PARTS: [(u32, u32); 18] = [
    (0x4001_2c00, !DIR),
    (0x4001_2c44, !MOE),
    (0x4001_3444, !MOE),
    (0x4000_0000, !DIR),
    (0x5000_0008, ADC_RUNS),
    (0x5000_0108, ADC_RUNS),
    (0x5000_0408, ADC_RUNS),
    (0x5000_0508, ADC_RUNS),
    // But the output of the comparator.
    (board::COMPARATOR_CSR, !(1 << 30)),
    // The memory at address 0; the faults that break.
    (0x4001_0000, 7),
    (0x4001_001c, 0xf),
    // AIRCR.PRIGROUP says which priorities preempt others. FPCCR.ASPEN and LSPEN make exceptions save the registers of the FPU.
    (0xe000_ed0c, 7 << 8),
    (0xe000_ef34, 3 << 30),
    (0xe000_e410, 0xff << 16),
    (0xe000_e424, 0xff << 24),
    (0xe000_e458, 0xff << 24),
    // The oscillators, the clock security system, and the PLL; the oscillator of the watchdog.
    (0x4002_1000, 1 << 8 | 3 << 16 | 1 << 19 | 3 << 24),
    (0x4002_1094, 1),
];

/// Number of these registers.
pub const COUNT: usize = {
    let (mut count, mut group) = (0, 0);
    while group < CONFIGURED.len() {
        count += CONFIGURED[group].1.len();
        group += 1;
    }
    count
};

fn addresses() -> impl Iterator<Item = u32> {
    CONFIGURED
        .iter()
        .flat_map(|(base, offsets)| offsets.iter().map(move |offset| base + u32::from(*offset)))
}

fn register(address: u32) -> Register {
    let part = PARTS.iter().find(|part| part.0 == address);
    Register { address, mask: part.map_or(u32::MAX, |part| part.1) }
}

/// The registers on which the control depends.
pub fn control() -> impl Iterator<Item = Register> {
    addresses().map(register)
}

/// The check and its progress.
#[derive(Debug)]
pub struct RegisterCheck {
    expected: &'static mut [u16; COUNT],
    next: usize,
}

/// The exclusive or of both halves.
pub fn halves(value: u32) -> u16 {
    (value >> 16 ^ value) as u16
}

impl RegisterCheck {
    /// A check of these registers with their contents now; `read` reads the word at an address.
    pub fn new(expected: &'static mut [u16; COUNT], read: impl Fn(u32) -> u32) -> Self {
        let mut new = Self { expected, next: 0 };
        new.renew(read);
        new
    }

    /// Takes the present contents as the reference.
    pub fn renew(&mut self, read: impl Fn(u32) -> u32) {
        for (Register { address, mask }, expected) in control().zip(self.expected.iter_mut()) {
            *expected = halves(read(address) & mask);
        }
    }

    /// Checks the next slice.
    ///
    /// # Errors
    /// A register that has changed, as the record of the run that it ends.
    pub fn slice(&mut self, read: impl Fn(u32) -> u32) -> Result<(), Record> {
        let both = addresses().zip(self.expected.iter());
        for (address, &expected) in both.skip(self.next).take(SLICE) {
            let Register { mask, .. } = register(address);
            let found = read(address) & mask;
            let changed = halves(found) ^ expected;
            if changed != 0 {
                let details = [address, found, changed.into(), 0];
                return Err(Record { reason: Reason::Register, details });
            }
        }
        self.next = if self.next + SLICE < COUNT { self.next + SLICE } else { 0 };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: usize = COUNT.div_ceil(SLICE);

    #[test]
    fn a_flip_is_found_in_one_whole_look_and_only_in_bits_that_stay() {
        let place = |at| control().position(|register| register.address == at).unwrap();
        let sound: Vec<u32> = (0..COUNT as u32).map(|n| n.wrapping_mul(2_654_435_769)).collect();
        for (which, bit) in (0..COUNT).flat_map(|n| (0..32).map(move |bit| (n, bit))) {
            let expected = Box::leak(Box::new([0; COUNT]));
            let mut check = RegisterCheck::new(expected, |at| sound[place(at)]);
            let passes = (which + bit) % (2 * WHOLE);
            assert!((0..passes).all(|_| check.slice(|at| sound[place(at)]).is_ok()));
            let mut words = sound.clone();
            words[which] ^= 1 << bit;
            let Register { address, mask } = control().nth(which).unwrap();
            let details = [address, words[which] & mask, 1 << (bit % 16), 0];
            let changed = Record { reason: Reason::Register, details };
            let found = (0..WHOLE).try_for_each(|_| check.slice(|at| words[place(at)]));
            let stays = mask >> bit & 1 == 1;
            assert_eq!(found, if stays { Err(changed) } else { Ok(()) }, "bit {bit}");
        }
    }

    #[test]
    fn no_register_is_there_twice() {
        let mut addresses: Vec<u32> = control().map(|register| register.address).collect();
        addresses.sort_unstable();
        assert!(addresses.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
