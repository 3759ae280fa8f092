//! The image on the board: its start, its messages, and the ways in which it ends.

use crate::common;
use anyhow::{Context, Result};
use drive_core::State;
use stm32g4_unicorn::cpu::Register;
use stm32g4_unicorn::memory;
use stm32g4_unicorn::periph::Reset;

/// Number of periods between two reports of the control to the console.
const REPORT: u64 = 601;

/// The window watchdog resets a hanging core, which switches the outputs off, and the next run reports the reason.
#[test]
fn a_hanging_core_is_off_within_three_periods() -> Result<()> {
    let mut pair = common::regulating(2)?;
    pair.order("torque 2")?;
    pair.run(1200, |_, _| {})?;
    let began = pair.board.time();
    pair.board.hang();
    while pair.board.chip().tim1.outputs_on() {
        pair.board.run_ticks(2000)?;
        assert!(pair.board.time() - began < 3.1 / 6000.0, "still on");
    }
    assert_eq!(pair.board.resets.last().map(|r| r.1), Some(Reset::Window));
    common::until_said(&mut pair.board, "last run: reset by window watchdog").map(drop)
}

/// The main loop hangs while the control interrupt continues: the independent watchdog is not fed.
#[test]
fn a_hanging_main_loop_is_off_within_six_milliseconds() -> Result<()> {
    hang_main_loop(|at| at)
}

/// The same at an address without code: time continues there too.
#[test]
fn a_main_loop_lost_in_ram_is_off_within_six_milliseconds() -> Result<()> {
    hang_main_loop(|_| memory::RAM + memory::RAM_SIZE - 4096)
}

/// Makes the main loop hang by a jump to itself at the place that `place` computes from the address of the loop.
fn hang_main_loop(place: impl Fn(u32) -> u32) -> Result<()> {
    let mut board = common::regulating(2)?.board;
    // The place where the main loop sleeps, or would continue.
    let sleep = board.image.symbol("induction_drive::chip::sleep::until_interrupt")?;
    let mut at = 0;
    for _ in 0..100_000 {
        board.run_ticks(100)?;
        at = board.cpu.get(Register::PC);
        if (sleep.address..sleep.address + sleep.size).contains(&at) {
            break;
        }
    }
    assert!(at >= sleep.address, "it never sleeps");
    let place = place(at);
    board.cpu.write(place, &0xe7fe_u16.to_le_bytes());
    board.cpu.set(Register::PC, place);
    board.run_periods(6)?;
    assert!(board.chip().tim1.outputs_on());
    board.run_periods(30)?;
    assert_eq!(board.resets.last().map(|r| r.1), Some(Reset::Watchdog));
    assert!(!board.chip().tim1.outputs_on());
    Ok(())
}

/// The break pin switches the outputs off in hardware, before the firmware is informed.
#[test]
fn a_break_switches_off_and_is_reported() -> Result<()> {
    let mut pair = common::regulating(3)?;
    pair.board.set_fault_pin(false);
    assert!(!pair.board.chip().tim1.outputs_on());
    pair.run(2, |_, _| {})?;
    assert_eq!(pair.shadow.drive.state(), State::Fault(drive_core::Fault::Break));
    // The console learns of it with the next report, and says so within 0.2 s.
    pair.run(REPORT + 1200, |_, _| {})?;
    assert!(pair.board.take_console().contains("fault 20"));
    Ok(())
}

/// If the crystal stops, the chip switches the outputs off; the firmware restarts from its internal oscillator and says
/// so.
#[test]
fn a_dead_crystal_switches_off_and_restarts() -> Result<()> {
    let mut pair = common::regulating(4)?;
    pair.board.take_console();
    pair.board.set_crystal(false);
    pair.board.run_ticks(2000)?;
    assert!(!pair.board.chip().tim1.outputs_on());
    common::until_said(&mut pair.board, "clock or flash failure")?;
    let log = pair.board.take_log()?;
    assert!(log.iter().any(|line| line.contains("internal oscillator")), "{log:#?}");
    Ok(())
}

/// A bit flips in the control's code, or in its coefficients: the outputs are off within 20 ms, and the next run
/// reports the reason.
#[test]
fn a_flipped_bit_in_code_or_coefficients_ends_it() -> Result<()> {
    let mut pair = common::regulating(6)?;
    let running = pair.board.keep()?;
    for (code, reason) in
        [(true, "74 code of the control"), (false, "75 coefficients of the control")]
    {
        pair.board.go_back(&running)?;
        // The last word of the code, which is padding or never executed here; or the magnetising current, found by its value.
        let address = if code {
            pair.board.image.symbol("__eccm")?.address - 4
        } else {
            let region = pair.board.addresses().coefficients;
            let i_d = Some(pair.shadow.settings().i_d().to_bits());
            let mut words = (region.address..region.end()).step_by(4);
            words.find(|at| pair.board.cpu.word(*at) == i_d).context("no magnetising current")?
        };
        let word = pair.board.cpu.word(address).unwrap_or(0) ^ 1 << 20;
        pair.board.cpu.write(address, &word.to_le_bytes());
        let began = pair.board.time();
        while pair.board.chip().tim1.outputs_on() {
            pair.board.run_ticks(2000)?;
            assert!(pair.board.time() - began < 20e-3, "still on");
        }
        let heard = common::until_said(&mut pair.board, reason)?;
        assert!(heard.contains("reset by software"), "{heard}");
    }
    Ok(())
}
