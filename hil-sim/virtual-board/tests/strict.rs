//! Images on the stricter board: ours breaks no rule of the chip, a halted core ends with the outputs off, and an old
//! image with known faults is detected.

use crate::common;
use std::path::Path;

use anyhow::{Context, Result};
use hil_sim::Config;
use stm32g4_unicorn::cpu::Register;
use stm32g4_unicorn::periph::Reset;
use stm32g4_unicorn::rules::{Rule, Violation};
use virtual_board::board::Debugger;
use virtual_board::{Board, Counting, Image, Options};

/// Largest number of periods that an image needs from reset to its greeting.
const START: u64 = 15_000;
/// Environment variable with the image that [`the_old_image_is_caught`] runs.
const OLD: &str = "INDUCTION_DRIVE_OLD_ELF";

/// Returns a board that stops at every instruction, so that the distance of two accesses is known.
fn exact(image: Image) -> Result<Board> {
    let mut options = Options::new(&Config::default(), 1);
    options.counting = Counting { cycles: true, every_instruction: true };
    let mut board = Board::new(image, options)?;
    board.collect_violations();
    Ok(board)
}

fn text(violations: &[Violation]) -> String {
    violations.iter().map(|violation| format!("{violation}, {} times\n", violation.count)).collect()
}

/// Runs until the outputs are on.
fn started(board: &mut Board) -> Result<()> {
    board.type_line("start");
    for _ in 0..600 {
        board.run_periods(10)?;
        if board.chip().tim1.outputs_on() {
            return Ok(());
        }
    }
    anyhow::bail!("it does not switch on: {}", board.take_console())
}

/// From reset to its greeting, a `save`, and outputs on.
#[test]
fn our_image_breaks_no_rule() -> Result<()> {
    let mut board = exact(Image::built()?)?;
    common::until_said(&mut board, "last run: ")?;
    board.type_line("confirm board");
    // Changed and changed back, without a design, so that there is something to save.
    for line in ["set command.timeout_s 3", "save", "set command.timeout_s 0", "save"] {
        board.type_line(line);
        board.run_periods(1200)?;
    }
    assert!(board.chip().flash.operations > 0, "{}", board.take_console());
    started(&mut board)?;
    board.run_periods(600)?;
    assert!(board.violations().is_empty(), "{}", text(board.violations()));
    assert!(board.resets.is_empty(), "{:?}", board.resets);
    Ok(())
}

/// A debugger halts the core, for two periods or longer, and continues it: the outputs are off then, and stay off.
/// After the longer halts the watchdog has reset the chip, regardless of what the debugger stops during a halt.
#[test]
fn after_halt_and_resume_the_outputs_are_off() -> Result<()> {
    let mut regulating = common::regulating(11)?.board;
    let state = regulating.keep()?;
    for (debugger, ms) in
        Debugger::ALL.into_iter().flat_map(|d| [(d, 0.35), (d, 10.0), (d, 1000.0)])
    {
        let board = &mut regulating;
        board.go_back(&state)?;
        board.resets.clear();
        board.attach(debugger);
        // Time for a pass of the main loop.
        board.run_periods(2)?;
        board.halt(ms)?;
        let reset = board.resets.last().map(|reset| reset.1);
        assert!(ms < 5.0 || reset == Some(Reset::Window), "{debugger:?}, {ms} ms: {reset:?}");
        board.resume();
        // They may be on for a period at most, if the watchdog has not reset the chip in the meantime.
        let mut on = 0;
        for _ in 0..1200 {
            board.run_ticks(2000)?;
            on += u32::from(board.chip().tim1.outputs_on());
        }
        println!("{debugger:?}, halt of {ms} ms: on for {} us", 2000 * on / 170);
        let allowed = if ms < 5.0 { 15 } else { 0 };
        assert!(on <= allowed, "on {on} times after a halt of {ms} ms by {debugger:?}");
        assert!(board.violations().is_empty(), "{}", text(board.violations()));
    }
    Ok(())
}

/// A probe that detaches clears `DBG_SLEEP`: the time base continues.
#[test]
fn a_detached_probe_changes_nothing() -> Result<()> {
    let mut board = Board::new(Image::built()?, Options::new(&Config::default(), 12))?;
    board.attach(Debugger::ProbeRs);
    common::until_said(&mut board, "last run: ")?;
    board.detach();
    board.run_periods(6000)?;
    assert!(board.resets.is_empty(), "{:?}", board.resets);
    Ok(())
}

/// Below the level of the supply monitor the outputs go off in hardware; a brown-out resets the chip.
#[test]
fn a_sagging_supply_switches_off() -> Result<()> {
    let mut board = common::regulating(14)?.board;
    board.chip().set_supply(2.9);
    board.run_periods(2)?;
    assert!(board.chip().tim1.outputs_on());
    board.chip().set_supply(2.7);
    assert!(!board.chip().tim1.outputs_on());
    board.chip().set_supply(1.5);
    board.run_periods(60)?;
    assert_eq!(board.resets.last().map(|reset| reset.1), Some(Reset::Power));
    board.chip().set_supply(3.3);
    common::until_said(&mut board, "last run: reset by power-on").map(drop)
}

/// A stack that has grown into the guard below it is a fault, and the next run reports it.
#[test]
fn a_stack_in_the_guard_faults() -> Result<()> {
    let mut board = Board::new(Image::built()?, Options::new(&Config::default(), 15))?;
    common::until_said(&mut board, "last run: ")?;
    let guard = board.chip().scs.mpu.guard().context("no guard")?;
    board.cpu.set(Register::SP, guard.end() + 16);
    board.run_periods(60)?;
    assert_eq!(board.resets.last().map(|reset| reset.1), Some(Reset::Software));
    common::until_said(&mut board, "reset by software").map(drop)
}

/// The image of commit 1abee12, in which a review found faults F1 to F7, fails for each of them:
///
/// ```text
/// git worktree add ../old 1abee12 && cd ../old && cargo xtask firmware && cd -
/// INDUCTION_DRIVE_OLD_ELF=../old/target/.../firmware/induction-drive \
///     cargo test --release strict -- --ignored --nocapture
/// ```
#[test]
#[ignore = "needs the image of another commit"]
fn the_old_image_is_caught() -> Result<()> {
    let path = std::env::var_os(OLD).with_context(|| format!("{OLD} names no image"))?;
    let image = || Image::open(Path::new(&path));
    let broken = |board: &Board, rule| board.violations().iter().any(|v| v.rule == rule);
    let mut board = exact(image()?)?;
    board.run_periods(START)?;
    println!("{}", text(board.violations()));
    let power = [Rule::ClockGate, Rule::VoltageRange, Rule::Latency, Rule::SupplyMonitor];
    let level = [Rule::DacMode, Rule::DacReady];
    for (finding, rules) in [
        ("F1", &power[..]),
        ("F4", &[Rule::LockOnce]),
        ("F6", &[Rule::EnableDelay, Rule::AdcClock]),
        ("F7", &level),
    ] {
        for rule in rules {
            assert!(broken(&board, *rule), "{finding}: {rule:?}");
        }
    }
    // Without the check of the distance of two accesses its ADCs start, and the other faults can be seen.
    let running = || -> Result<Board> {
        let mut board = Board::new(image()?, Options::new(&Config::default(), 1))?;
        board.collect_violations();
        board.attach(Debugger::ProbeRs);
        board.run_periods(START)?;
        Ok(board)
    };
    // The watchdog's registers are busy for longer than it waits: a reset while it saves, unless they are quick.
    let mut board = running()?;
    board.type_line("save");
    board.run_periods(1200)?;
    println!("F13: {:?}", board.resets);
    assert_eq!(board.resets.last().map(|reset| reset.1), Some(Reset::Watchdog), "F13");
    let mut board = running()?;
    board.chip().iwdg.quick = true;
    board.type_line("save");
    board.run_periods(1200)?;
    println!("F5: {:?}", board.take_console());
    assert!(broken(&board, Rule::DataCache), "F5");
    started(&mut board)?;
    board.halt(10_000.0)?;
    assert!(!board.chip().tim1.outputs_on());
    board.resume();
    board.run_periods(3)?;
    println!("F2: outputs on after the halt: {}", board.chip().tim1.outputs_on());
    assert!(broken(&board, Rule::ResumedOutputs), "F2");
    let mut board = running()?;
    let resets = board.resets.len();
    board.detach();
    board.run_periods(START)?;
    println!("F3: resets after the probe has detached: {:?}", board.resets);
    assert!(board.resets.len() > resets, "F3");
    Ok(())
}
