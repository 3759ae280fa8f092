//! Bits of configuration registers flip while the drive regulates: the outputs go off and the chip restarts.

use crate::common;
use anyhow::{Result, ensure};
use induction_drive::monitor::register_check::control;
use stm32g4_unicorn::periph::Reset;

/// Registers and bits, one of each peripheral on which the control depends and that nothing else checks.
const FLIPS: [(&str, u32, u32); 14] = [
    ("TIM1_CR1.CKD, on which the dead time depends", 0x4001_2c00, 8),
    ("TIM1_DIER.UDE", 0x4001_2c0c, 8),
    ("TIM1_SMCR.ETP", 0x4001_2c08, 15),
    ("TIM8_ARR", 0x4001_342c, 3),
    ("TIM2_ARR", 0x4000_002c, 30),
    ("ADC1_TR1, the limit of the analog watchdog, upwards", 0x5000_0020, 24),
    ("ADC2_SMPR1", 0x5000_0114, 29),
    ("DAC3_DHR12R1, the level of the comparator", 0x5000_1008, 2),
    ("GPIOA_OTYPER of a gate", 0x4800_0004, 8),
    ("GPIOB_PUPDR", 0x4800_040c, 29),
    ("NVIC priority of USART3", 0xe000_e424, 30),
    ("FLASH_ACR.PRFTEN", 0x4002_2000, 8),
    ("RCC_APB2ENR.TIM15EN", 0x4002_1060, 16),
    ("RCC_CCIPR.ADC12SEL", 0x4002_1088, 28),
];

#[test]
fn a_flipped_bit_in_a_register_ends_the_run() -> Result<()> {
    let mut board = common::regulating(17)?.board;
    board.collect_violations();
    let running = board.keep()?;
    for (name, address, bit) in FLIPS {
        assert!(control().any(|register| register.address == address), "{name}");
        board.go_back(&running)?;
        let chip = board.chip();
        let flipped = chip.read(address, 4) ^ 1 << bit;
        chip.write(address, 4, flipped);
        assert_eq!(chip.read(address, 4), flipped, "{name}: the model does not hold the bit");
        let began = chip.now;
        let (mut off, mut slices) = (None, 0);
        while board.resets.is_empty() {
            // A shorter dead time acts on the gates at once.
            if let Err(error) = board.run_ticks(2000) {
                ensure!(error.to_string().contains("dead time"), "{name}: {error:#}");
            }
            let chip = board.chip();
            if off.is_none() && !chip.tim1.outputs_on() {
                off = Some((chip.now - began) as f64 / 170e3);
            }
            slices += 1;
            assert!(slices < 25_000, "{name}: no reset");
        }
        // If a fault of the drive has come first, the reset follows when its entry of the history is written.
        let (reset, off) = (board.resets[0].1, off.unwrap());
        assert!(reset == Reset::Software && off < 3.0, "{name}: {reset}, off after {off} ms");
        assert!(!board.chip().tim1.outputs_on(), "{name}");
        board.run_periods(400)?;
        let log = board.take_log()?;
        let told = |line: &String| line.contains("ended with 77 register of the chip changed");
        assert!(log.iter().any(told), "{name}: {log:?}");
    }
    Ok(())
}
