//! The registers of a board that has started and is off, for the comparison with a real one (`cargo xtask bench-dump`).

use anyhow::{Context, Result};

use crate::{Board, Image, Options, PowerStage};

/// The registers that the firmware sets up, by peripheral with its address: name and offset of each, and the bits that are
/// the same after every start where these are not all, in hexadecimal.
const REGISTERS: [(&str, u32, &str); 23] = [
    // Oscillator, PLL and clock security on; the trimming bits are the chip's own.
    ("RCC", 0x4002_1000, "CR 00 1090000, CFGR 08 3fff, PLLCFGR 0c, AHB2ENR 4c, APB1ENR1 58"),
    ("RCC", 0x4002_1000, "APB1ENR2 5c, APB2ENR 60, CCIPR 88, CSR 94 1"),
    ("PWR", 0x4000_7000, "CR1 00 600, CR2 04 f, CR5 80 100, SR2 14 400"),
    // One or two banks; the other options are the owner's.
    ("FLASH", 0x4002_2000, "ACR 00 70f, CR 14 80000000, OPTR 20 400000"),
    ("SYSCFG", 0x4001_0000, "CFGR2 1c f"),
    ("GPIOA", 0x4800_0000, "MODER 00, PUPDR 0c, AFRL 20, AFRH 24"),
    ("GPIOB", 0x4800_0400, "MODER 00, PUPDR 0c, AFRL 20"),
    ("GPIOC", 0x4800_0800, "MODER 00, PUPDR 0c, AFRL 20"),
    // Not the direction.
    ("TIM1", 0x4001_2c00, "CR1 00 3ef, CR2 04, CCMR1 18, CCMR2 1c, CCER 20, PSC 28, ARR 2c"),
    ("TIM1", 0x4001_2c00, "RCR 30, CCR1 34, CCR4 40, BDTR 44, AF1 60"),
    ("TIM2", 0x4000_0000, "SMCR 08, CCMR1 18, CR1 00 1"),
    ("TIM8", 0x4001_3400, "CR1 00 3ef, CCMR1 18, CCER 20, ARR 2c, BDTR 44, AF1 60"),
    ("TIM5", 0x4000_0c00, "CR1 00 1, CCMR1 18, CCER 20, PSC 28 ffff, ARR 2c, TISEL 5c"),
    ("ADC1", 0x5000_0000, "CR 08 30000009, CFGR 0c, SMPR1 14, TR1 20 fff0fff, JSQR 4c, IER 04"),
    ("ADC2", 0x5000_0100, "CR 08 30000009, CFGR 0c, SMPR1 14, TR1 20 fff0fff, JSQR 4c, IER 04"),
    ("ADC12", 0x5000_0300, "CCR 08"),
    ("DAC3", 0x5000_1000, "CR 00 1, MCR 3c ffff, DHR12R1 08 fff"),
    ("COMP1", 0x4001_0200, "CSR 00 8fffffff"),
    ("LPUART1", 0x4000_8000, "BRR 0c"),
    // The probe sets bits of DBGMCU_CR; these two are the firmware's.
    ("DBGMCU", 0xe004_2000, "APB1FZR1 08 1008, APB2FZ 10 2800"),
    ("MPU", 0xe000_ed90, "CTRL 04 7"),
    ("IWDG", 0x4000_3000, "PR 04 7, RLR 08 fff"),
    ("WWDG", 0x4000_2c00, "CFR 04 3fff"),
];

/// The time after which every start is over, control periods.
const STARTED: u64 = 30_000;

/// The registers of a board some seconds after power-on, a line each: name, address, value, and the bits to compare, all
/// in hexadecimal.
///
/// # Errors
/// A failure of the board.
pub fn lines(image: Image, stage: &'static PowerStage) -> Result<Vec<String>> {
    let mut board = Board::new(image, Options::on(stage, &stage.config()?, 1))?;
    board.run_periods(STARTED)?;
    let chip = board.chip();
    let line = |(name, address, mask): (String, u32, u32)| {
        let value = chip.read(address, 4) & mask;
        format!("{name} {address:08x} {value:08x} {mask:08x}")
    };
    Ok(registers()?.into_iter().map(line).collect())
}

/// Name, address and bits to compare of each register.
///
/// # Errors
/// A row of the table that is none.
pub fn registers() -> Result<Vec<(String, u32, u32)>> {
    let mut all = Vec::new();
    for (peripheral, base, registers) in REGISTERS {
        for register in registers.split(", ") {
            let mut words = register.split(' ');
            let (name, offset) = words.next().zip(words.next()).context(register)?;
            let address = base + u32::from_str_radix(offset, 16)?;
            let mask = words.next().map_or(Ok(u32::MAX), |mask| u32::from_str_radix(mask, 16))?;
            all.push((format!("{peripheral}_{name}"), address, mask));
        }
    }
    Ok(all)
}
