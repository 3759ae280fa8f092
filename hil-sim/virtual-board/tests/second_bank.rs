//! The second bank of the flash while it is written: a fetch or a read from it would stop the core, interrupts and all. No
//! interrupt needs anything of it, nothing of it runs meanwhile, and no control period is missed or late.

use std::ops::Range;

use anyhow::{Result, ensure};
use drive_core::Hardware;
use hil_sim::Config;
use virtual_board::chip::TICKS_PER_PERIOD;
use virtual_board::memory::{BANK_2, FLASH, STORED};
use virtual_board::{Board, Image, Options};

/// Code of the second bank. Behind it lies what is stored.
const SECOND: Range<u32> = BANK_2..STORED;
/// The same without the copy of the control's code, which the main loop compares with the code in CCM all the time.
const DESIGN: Range<u32> = 0x0804_8000..STORED;
/// Latest start of a control period against the one before, ticks: 3 us.
const LATE: u64 = 500;
/// Ticks of a step, shorter than any interrupt.
const STEP: u64 = 40;

fn greeted(seed: u64) -> Result<Board> {
    let mut board = Board::new(Image::built()?, Options::new(&Config::default(), seed))?;
    while !board.take_console().ends_with('\n') {
        board.run_periods(10)?;
    }
    while board.next_period().is_some() {}
    Ok(board)
}

/// The compare values of some control periods while these lines are typed, a part of the flash spoilt in every interrupt.
fn compares(spoilt: Option<Range<u32>>) -> Result<Vec<String>> {
    let mut board = greeted(41)?;
    let place = spoilt.unwrap_or(FLASH..FLASH);
    let mut sound = vec![0; (place.end - place.start) as usize];
    board.read(place.start, &mut sound);
    let rubbish = vec![0xde; sound.len()];
    let mut seen = Vec::new();
    let lines = ["start torque", "torque 1", "torque -1", "stop", "start vf", "speed 300", "stop"];
    for line in lines {
        board.type_line(line);
        let (end, mut is_spoilt) = (board.chip().now + 400 * TICKS_PER_PERIOD, false);
        while board.chip().now < end || is_spoilt {
            board.run_ticks(STEP)?;
            let interrupts = !board.chip().scs.active.is_empty();
            if interrupts != is_spoilt {
                board.cpu().write(place.start, if interrupts { &rubbish } else { &sound });
                is_spoilt = interrupts;
            }
        }
        while let Some(period) = board.next_period() {
            seen.push(format!("{:?} {:?}", period.sample, period.compare));
        }
        ensure!(board.resets.is_empty(), "{line}: {:?}", board.resets);
    }
    Ok(seen)
}

/// Start, torque and V/f come out the same to the bit with rubbish in the second bank whenever an interrupt runs. In
/// the first bank, where vectors, tables and slow states are, the same rubbish does not go unseen.
#[test]
fn no_interrupt_needs_the_second_bank() -> Result<()> {
    let whole = compares(None)?;
    assert!(whole.len() > 2500, "{}", whole.len());
    assert!(whole.iter().any(|period| period.contains("enabled: true")));
    assert_eq!(compares(Some(DESIGN))?, whole);
    let first = compares(Some(FLASH..BANK_2));
    assert!(first.is_err() || first.is_ok_and(|periods| periods != whole), "rubbish was not seen");
    Ok(())
}

/// Two saves, an erasure of each slot, and an entry of the history: control periods come as ever, and while the flash is busy
/// the core is in the first bank or in CCM, never in the second, which it uses at other times.
#[test]
fn no_control_period_waits_for_the_flash() -> Result<()> {
    let mut board = greeted(42)?;
    let (mut in_first, mut in_second, mut last) = (0_u64, 0_u64, None);
    let lines = [
        "set command.timeout_s 3",
        "save",
        "set command.timeout_s 0",
        "save",
        "start torque",
        "fault",
    ];
    for line in lines {
        let operations = board.chip().flash.operations;
        match line {
            "fault" => board.set_fault_pin(false),
            line => board.type_line(line),
        }
        let end = board.chip().now + 900 * TICKS_PER_PERIOD;
        while board.chip().now < end {
            board.run_ticks(1)?;
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
    println!("{in_first} blocks in the first bank while busy, {in_second} in the second while not");
    assert!(in_first > 10_000 && in_second > 100 && board.resets.is_empty(), "{:?}", board.resets);
    Ok(())
}
