//! The registers of a board that has started and is off, for the comparison with a real one (`cargo xtask bench-dump`).

use anyhow::Result;

use crate::{Board, Image, Options, PowerStage};

/// A register: name, address, and the bits that are the same after every start.
pub type Register = (&'static str, u32, u32);

const ALL: u32 = u32::MAX;
const LOW_HALF: u32 = 0xffff;

/// The registers that the firmware sets up.
pub const REGISTERS: [Register; 66] = [
    // Oscillator, PLL and clock security on; the trimming bits are the chip's own.
    ("RCC_CR", 0x4002_1000, 1 << 24 | 1 << 19 | 1 << 16),
    ("RCC_CFGR", 0x4002_1008, 0x0000_3fff),
    ("RCC_PLLCFGR", 0x4002_100c, ALL),
    ("RCC_AHB2ENR", 0x4002_104c, ALL),
    ("RCC_APB1ENR1", 0x4002_1058, ALL),
    ("RCC_APB1ENR2", 0x4002_105c, ALL),
    ("RCC_APB2ENR", 0x4002_1060, ALL),
    ("RCC_CCIPR", 0x4002_1088, ALL),
    ("PWR_CR1", 0x4000_7000, 3 << 9),
    ("PWR_CR2", 0x4000_7004, 0xf),
    ("PWR_CR5", 0x4000_7080, 1 << 8),
    ("PWR_SR2", 0x4000_7014, 1 << 10),
    ("FLASH_ACR", 0x4002_2000, 0x0000_070f),
    ("FLASH_CR", 0x4002_2014, 1 << 31),
    // One or two banks; the other options are the owner's.
    ("FLASH_OPTR", 0x4002_2020, 1 << 22),
    ("SYSCFG_CFGR2", 0x4001_0018, 0xf),
    ("GPIOA_MODER", 0x4800_0000, ALL),
    ("GPIOA_PUPDR", 0x4800_000c, ALL),
    ("GPIOA_AFRL", 0x4800_0020, ALL),
    ("GPIOA_AFRH", 0x4800_0024, ALL),
    ("GPIOB_MODER", 0x4800_0400, ALL),
    ("GPIOB_PUPDR", 0x4800_040c, ALL),
    ("GPIOB_AFRL", 0x4800_0420, ALL),
    ("GPIOC_MODER", 0x4800_0800, ALL),
    ("GPIOC_PUPDR", 0x4800_080c, ALL),
    // Not the direction.
    ("TIM1_CR1", 0x4001_2c00, 0x0000_03ef),
    ("TIM1_CR2", 0x4001_2c04, ALL),
    ("TIM1_CCMR1", 0x4001_2c18, ALL),
    ("TIM1_CCMR2", 0x4001_2c1c, ALL),
    ("TIM1_CCER", 0x4001_2c20, ALL),
    ("TIM1_PSC", 0x4001_2c28, ALL),
    ("TIM1_ARR", 0x4001_2c2c, ALL),
    ("TIM1_RCR", 0x4001_2c30, ALL),
    ("TIM1_CCR1", 0x4001_2c34, ALL),
    ("TIM1_CCR4", 0x4001_2c40, ALL),
    ("TIM1_BDTR", 0x4001_2c44, ALL),
    ("TIM1_AF1", 0x4001_2c60, ALL),
    ("TIM2_SMCR", 0x4000_0008, ALL),
    ("TIM2_CCMR1", 0x4000_0018, ALL),
    ("TIM2_CR1", 0x4000_0000, 1),
    ("TIM5_CR1", 0x4000_0c00, 1),
    ("TIM5_PSC", 0x4000_0c28, LOW_HALF),
    ("TIM5_ARR", 0x4000_0c2c, ALL),
    ("ADC1_CR", 0x5000_0008, 1 << 28 | 1 << 29 | 1 << 3 | 1),
    ("ADC1_CFGR", 0x5000_000c, ALL),
    ("ADC1_SMPR1", 0x5000_0014, ALL),
    ("ADC1_TR1", 0x5000_0020, 0x0fff_0fff),
    ("ADC1_JSQR", 0x5000_004c, ALL),
    ("ADC1_IER", 0x5000_0004, ALL),
    ("ADC2_CR", 0x5000_0108, 1 << 28 | 1 << 29 | 1 << 3 | 1),
    ("ADC2_CFGR", 0x5000_010c, ALL),
    ("ADC2_SMPR1", 0x5000_0114, ALL),
    ("ADC2_TR1", 0x5000_0120, 0x0fff_0fff),
    ("ADC2_JSQR", 0x5000_014c, ALL),
    ("ADC2_IER", 0x5000_0104, ALL),
    ("ADC12_CCR", 0x5000_0308, ALL),
    ("DAC3_CR", 0x5000_1000, 1),
    ("DAC3_MCR", 0x5000_103c, LOW_HALF),
    ("DAC3_DHR12R1", 0x5000_1008, 0xfff),
    ("COMP1_CSR", 0x4001_0200, 0x8fff_ffff),
    ("LPUART1_BRR", 0x4000_800c, ALL),
    // The probe sets bits of DBGMCU_CR; these two are the firmware's.
    ("DBGMCU_APB1FZR1", 0xe004_2008, 1 << 12 | 1 << 3),
    ("DBGMCU_APB2FZ", 0xe004_2010, 1 << 11),
    ("MPU_CTRL", 0xe000_ed94, 7),
    ("IWDG_PR", 0x4000_3004, 7),
    ("IWDG_RLR", 0x4000_3008, 0xfff),
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
    Ok(REGISTERS
        .iter()
        .map(|(name, address, mask)| {
            let value = chip.read(*address, 4) & mask;
            format!("{name} {address:08x} {value:08x} {mask:08x}")
        })
        .collect())
}
