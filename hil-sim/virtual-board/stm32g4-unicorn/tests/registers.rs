//! Independent checks of the registers: reset values and writable bits of every modelled register against the
//! peripheral access crate `stm32g4` (ST's SVD with the corrections of stm32-rs; its source is read) and against the
//! data of `stm32-metapac` (embassy); clocks and pins against the latter.

mod metapac;
mod svd;

use std::collections::BTreeMap;

use anyhow::Result;
use stm32g4_unicorn::Chip;
use stm32g4_unicorn::chip::{clock_of, pins};
use svd::BLOCKS;

/// Registers in which access crate and model differ after reset: the value of the crate, and the reason why the model's value is right.
const RESETS: &[(&str, u32, &str)] = &[
    ("RCC_CR", 0x63, "MSI bits of another family; RM0440: HSION and HSIRDY"),
    ("FLASH_ACR", 0x600, "DBG_SWEN is set after reset (RM0440, FLASH_ACR: 0x0004_0600)"),
    ("TIM1_AF1", 0, "BKINE is set after reset (RM0440)"),
    ("TIM8_AF1", 0, "as TIM1_AF1"),
    ("TIM1_AF2", 0, "BK2INE is set after reset (RM0440)"),
    ("USART3_ISR", 0, "TXE and TC are set after reset (RM0440)"),
    ("DBGMCU_IDCODE", 0, "the identity of this chip, not a value of reset"),
    ("GPIOA_IDR", 0, "levels: JTMS and JTDI are pulled up"),
    ("GPIOB_IDR", 0, "levels: NJTRST is pulled up"),
];

/// Bits of a register that the model does not accept although both sources call them fields, and the reason.
const READ_ONLY: &[(&str, u32, &str)] = &[
    ("TIM1_CR1", 0x10, "DIR is read-only in centre-aligned mode"),
    ("TIM1_SR", 0xf3_3fff, FLAGS),
    ("TIM1_CNT", 0xffff, "not modelled: the counter is set by UG alone"),
    ("TIM1_PSC", 0xffff, "not modelled: a prescaler is refused as unknown"),
    ("TIM1_BDTR", 0x8000, "MOE: the pin of the break is low at first, so the break clears it"),
    ("TIM2_SR", 0xf0_1e5f, FLAGS),
    ("TIM5_SR", 0xf0_1e5f, FLAGS),
    ("TIM5_CCR1", u32::MAX, "a capture is read-only"),
    ("TIM5_CNT", u32::MAX, "not modelled: the counter is set by UG alone"),
    ("TIM16_SR", 0x2a3, FLAGS),
    ("TIM16_CCR1", 0xf_ffff, "a capture is read-only"),
    ("TIM16_CNT", 0xffff, "not modelled: the counter is set by UG alone"),
    ("IWDG_PR", 7, KEY),
    ("IWDG_RLR", 0xfff, KEY),
    ("IWDG_WINR", 0xfff, KEY),
    ("WWDG_SR", 1, FLAGS),
    ("LPUART1_TDR", 0x1ff, "write-only"),
    ("USART3_TDR", 0x1ff, "write-only"),
    ("SYSCFG_CFGR2", 0x100, FLAGS),
    ("EXTI_PR1", 0x7b_ffff, FLAGS),
    ("EXTI_PR2", 0x303, FLAGS),
    ("RCC_BDCR", 0x0301_833d, "the backup domain is not modelled"),
    ("RCC_CSR", 0x80_0000, "RMVF clears the flags and itself"),
    ("FLASH_SR", 0xc3fb, FLAGS),
    ("FLASH_CR", 0xff07_8bff, KEY),
    ("FLASH_ECCR", 0xf100_0000, FLAGS),
    ("FLASH_OPTR", 0x7fdf_77ff, OPTIONS),
    ("FLASH_PCROP1SR", 0x7fff, OPTIONS),
    ("FLASH_WRP1AR", 0x7f_007f, OPTIONS),
    ("FLASH_WRP1BR", 0x7f_007f, OPTIONS),
    ("ADC1_ISR", 0x7ff, FLAGS),
    ("ADC1_CR", 0x8000_003f, ACTIONS),
    ("ADC2_ISR", 0x7ff, FLAGS),
    ("ADC2_CR", 0x8000_003f, ACTIONS),
    ("DAC1_SR", 0x3800_3800, FLAGS),
    ("DAC3_SR", 0x3800_3800, FLAGS),
];
const FLAGS: &str = "flags, cleared by a write";
const KEY: &str = "locked until a key is written";
const OPTIONS: &str = "option bytes: locked until a key is written, which is not modelled";
const ACTIONS: &str = "set by a write under conditions, cleared by the ADC";

/// Bits that the model accepts although neither source names them, and the reason.
const MODEL_ONLY: &[(&str, u32, &str)] = &[];

/// Returns a chip whose peripherals have their clocks.
fn clocked() -> Chip {
    let mut chip = Chip::default();
    for (register, bits) in [
        (0x48, 0x111f),
        (0x4c, 0x050f_607f),
        (0x58, 0xd2fe_cd3f),
        (0x5c, 0x103),
        (0x60, 0x0437_f801),
    ] {
        chip.write(0x4002_1000 + register, 4, bits);
    }
    chip.now = 1000;
    chip
}

/// Returns the value of a register; `None` if it is not modelled.
fn read(chip: &mut Chip, address: u32) -> Option<u32> {
    let value = chip.read(address, 4);
    chip.unknown.take().is_none().then_some(value)
}

/// Returns the bits of a register that follow a write.
fn writable(address: u32) -> u32 {
    let after = |value| {
        let mut chip = clocked();
        chip.write(address, 4, value);
        chip.unknown = None;
        chip.now += 1000;
        chip.read(address, 4)
    };
    after(u32::MAX) ^ after(0)
}

#[test]
fn reset_values_are_those_of_the_access_crate() -> Result<()> {
    let mut compared = 0;
    let mut wrong = Vec::new();
    for (module, peripheral, base) in BLOCKS {
        for register in svd::registers(module)? {
            let address = base + register.offset;
            // The enable registers were written.
            let mut chip = if peripheral == "RCC" { Chip::default() } else { clocked() };
            let Some(value) = read(&mut chip, address) else { continue };
            compared += 1;
            let name = format!("{peripheral}_{}", register.name.to_uppercase());
            let listed = RESETS.iter().find(|known| known.0 == name);
            let expected = listed.map_or(register.reset, |known| known.1);
            if register.reset != expected || (value != register.reset) != listed.is_some() {
                wrong.push(format!("{name}: {value:#x}, crate {:#x}", register.reset));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(compared > 200, "{compared}");
    Ok(())
}

#[test]
fn writable_bits_are_those_of_both_sources() -> Result<()> {
    let mut wrong = Vec::new();
    for (module, peripheral, base) in BLOCKS {
        let theirs: BTreeMap<_, _> = metapac::registers(peripheral);
        for register in svd::registers(module)? {
            let address = base + register.offset;
            let known = read(&mut clocked(), address).is_some();
            if !known || !register.readable || !register.writable {
                continue;
            }
            let name = format!("{peripheral}_{}", register.name.to_uppercase());
            let second = theirs.get(&register.offset).copied().unwrap_or(0);
            let ours = writable(address);
            let missing = register.fields & second & !ours;
            let extra = ours & !(register.fields | second);
            let listed = |list: &[(&str, u32, &str)]| {
                list.iter().find(|known| known.0 == name).map_or(0, |known| known.1)
            };
            if missing != listed(READ_ONLY) || extra != listed(MODEL_ONLY) {
                wrong.push(format!(
                    "{name}: {ours:#x}, crate {:#x}, metapac {second:#x}: missing {missing:#x}, extra {extra:#x}",
                    register.fields
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    Ok(())
}

#[test]
fn clocks_are_those_of_the_second_source() {
    let mut compared = 0;
    for (_, peripheral, base) in BLOCKS {
        let ours = clock_of(base).map(|(_, register, bit)| (register, bit));
        let theirs = metapac::clock(peripheral);
        // The comparators and the common registers of the ADCs have no clock of their own there.
        if let Some(theirs) = theirs {
            assert_eq!(ours, Some(theirs), "{peripheral}");
            compared += 1;
        }
    }
    assert!(compared >= 12, "{compared}");
}

#[test]
fn pins_are_those_of_the_second_source() {
    let signals = pins::OUTPUTS.iter().chain([&pins::BREAK]).chain(&pins::ENCODER);
    for signal in signals.chain(&pins::SERIAL).chain(&pins::BUS) {
        let mut ours: Vec<_> = pins::pins_of(*signal).collect();
        let mut theirs = metapac::pins_of(signal.0);
        ours.sort_unstable();
        theirs.sort_unstable();
        assert_eq!(ours, theirs, "{}", signal.0);
    }
    for converter in 0..4 {
        for channel in 0..19 {
            let theirs = metapac::analog_pin(converter, channel);
            assert_eq!(pins::analog(converter, channel), theirs, "ADC{} {channel}", converter + 1);
        }
    }
}
