//! The second bank of the flash while it is written: a fetch or a read from it would stop the core, including its
//! interrupts. No interrupt needs anything from it, no code in it runs meanwhile, and no control period is missed or
//! late. An interrupt that did need it would be late by the whole operation.

use std::ops::Range;

use crate::common;
use anyhow::{Result, ensure};
use drive_core::Hardware;
use hil_sim::Config;
use stm32g4_unicorn::memory::{BANK_2, FLASH, STORED};
use stm32g4_unicorn::periph::Reset;
use virtual_board::board::{CONTROL_INTERRUPT, TICKS_PER_PERIOD};
use virtual_board::{Board, Image, Options};

/// Code of the second bank. The settings area follows it.
const SECOND: Range<u32> = BANK_2..STORED;
/// The second bank without the copy of the control's code, which the main loop always compares with the code in CCM.
const DESIGN: Range<u32> = 0x0804_8000..STORED;
/// Largest jitter of a control period, ticks: 3 us.
const LATE: u64 = 500;
/// Ticks of a step, shorter than any interrupt.
const STEP: u64 = 40;

fn greeted(seed: u64) -> Result<Board> {
    let mut board = Board::new(Image::built()?, Options::new(&Config::default(), seed))?;
    common::until_said(&mut board, "last run: ")?;
    Ok(board)
}

/// Returns the compare values of some control periods while these lines are typed, with a part of the flash corrupted in every interrupt.
fn compares(spoilt: Option<Range<u32>>) -> Result<Vec<String>> {
    let mut board = greeted(41)?;
    let place = spoilt.unwrap_or(FLASH..FLASH);
    let mut sound = vec![0; (place.end - place.start) as usize];
    board.cpu.read(place.start, &mut sound);
    let rubbish = vec![0xde; sound.len()];
    let (mut seen, mut answered) = (Vec::new(), 0);
    let lines =
        ["start torque", "torque 1", "torque -1", "stop", "start vf", "speed 300", "stop", "learn"];
    for line in lines {
        board.type_line(line);
        // Reads the state word and the speed of the slave with the address 1.
        board.send_bus(&[1, 3, 0, 0, 0, 2, 0xc4, 0x0b]);
        let (end, mut is_spoilt) = (board.chip().now + 400 * TICKS_PER_PERIOD, false);
        while board.chip().now < end || is_spoilt {
            // The end of an interrupt must be met exactly, because the preempted code needs the bank.
            board.run_ticks(if is_spoilt { 1 } else { STEP })?;
            let interrupts = !board.chip().scs.active.is_empty();
            if interrupts != is_spoilt {
                board.cpu.write(place.start, if interrupts { &rubbish } else { &sound });
                is_spoilt = interrupts;
            }
        }
        while let Some(period) = board.next_period() {
            seen.push(format!("{:?} {:?}", period.sample, period.compare));
        }
        ensure!(board.resets.is_empty(), "{line}: {:?}", board.resets);
        answered += usize::from(!board.take_bus().is_empty());
    }
    // A start runs the design before it reads the bus.
    ensure!(answered >= lines.len() - 2, "{answered} answers on the bus");
    Ok(seen)
}

/// Start, torque and V/f give exactly the same results with corrupted data in the second bank whenever an interrupt
/// runs. In the first bank, which holds vectors, tables and slow states, the same corruption has an effect.
#[test]
fn no_interrupt_needs_the_second_bank() -> Result<()> {
    let whole = compares(None)?;
    assert!(whole.len() > 2500, "{}", whole.len());
    assert!(whole.iter().any(|period| period.contains("enabled: true")));
    assert_eq!(compares(Some(DESIGN))?, whole);
    let first = compares(Some(FLASH..BANK_2));
    assert!(first.is_err() || first.is_ok_and(|periods| periods != whole), "corruption not seen");
    Ok(())
}

/// Two saves, an erasure of each slot, and an entry of the history: control periods come as usual. While the flash is
/// busy the core is in the first bank or in CCM, never in the second, which it uses at other times.
#[test]
fn no_control_period_waits_for_the_flash() -> Result<()> {
    let mut board = greeted(42)?;
    let (mut in_first, mut in_second, mut last) = (0_u64, 0_u64, None);
    let lines = ["set bus.address 3", "save", "set bus.address 1", "save", "start torque", "fault"];
    for line in lines {
        let operations = board.chip().flash.operations;
        match line {
            "fault" => board.set_fault_pin(false),
            line => board.type_line(line),
        }
        let end = board.chip().now + 900 * TICKS_PER_PERIOD;
        while board.chip().now < end {
            let chip = board.chip();
            let busy = chip.flash.is_busy(chip.now);
            board.run_ticks(if busy { 1 } else { STEP })?;
            let chip = board.chip();
            let second = SECOND.contains(&chip.at);
            if chip.flash.is_busy(chip.now) {
                in_first += u64::from((FLASH..BANK_2).contains(&chip.at));
                assert!(!second, "{line}: {:#x} while it is busy", chip.at);
            } else {
                in_second += u64::from(second);
            }
        }
        let writes = line == "save" || line == "fault";
        assert_eq!(
            board.chip().flash.operations > operations,
            writes,
            "{line}: {}",
            board.take_console()
        );
        while let Some(period) = board.next_period() {
            let since = last.map_or(TICKS_PER_PERIOD, |last| period.began - last);
            assert!(since.abs_diff(TICKS_PER_PERIOD) < LATE, "{line}: a period of {since} ticks");
            assert!(!period.sample.hardware.contains(Hardware::DEADLINE_MISS), "{line}");
            last = Some(period.began);
        }
    }
    let log = board.take_log()?;
    assert!(!log.iter().any(|line| line.contains("too long")), "{log:#?}");
    // At other times the second bank is in use.
    assert!(in_first > 10_000 && in_second > 100 && board.resets.is_empty(), "{:?}", board.resets);
    Ok(())
}

/// Addresses in the first and in the second bank that the image does not use.
const FREE: [u32; 2] = [0x0803_ff00, 0x0805_ff00];

/// Puts a piece of code before the control interrupt, as if the linker had left a part of it there: in the second bank,
/// or in the first bank with a word of the second that it reads.
fn before_the_control(board: &mut Board, reads: bool) {
    let vector = board.chip().scs.vector(CONTROL_INTERRUPT);
    let handler = board.cpu.word(vector).unwrap();
    let place = FREE[usize::from(!reads)];
    // ldr r0, [pc, #4]; ldr r0, [r0]; ldr pc, [pc, #4]; a word of the second bank; the handler. Or: ldr pc, [pc, #0]; the handler.
    let words: &[u32] = if reads {
        &[0x6800_4801, 0xf004_f8df, SECOND.start, handler]
    } else {
        &[0xf000_f8df, handler]
    };
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    board.cpu.write(place, &bytes);
    board.cpu.write(vector, &(place | 1).to_le_bytes());
}

/// The control interrupt with a piece of code or a word in the second bank: it works until the flash is written. Then
/// it does not come until the window watchdog ends the run.
#[test]
fn an_interrupt_that_needs_the_second_bank_waits_for_the_flash() -> Result<()> {
    for reads in [false, true] {
        let mut board = greeted(43)?;
        before_the_control(&mut board, reads);
        board.run_periods(600)?;
        let periods = std::iter::from_fn(|| board.next_period()).count();
        assert!(periods >= 599 && board.resets.is_empty(), "{periods}, {:?}", board.resets);
        board.type_line("save");
        board.run_periods(400)?;
        let ended = board.resets.first().map(|reset| reset.1);
        assert_eq!(ended, Some(Reset::Window), "data: {reads}: {}", board.take_console());
    }
    Ok(())
}
