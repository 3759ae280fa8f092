//! The fault campaign: each class with a protection of its own fails without that protection, and passes with it; and
//! the page of its results lists every class.

use anyhow::{Context, Result};
use induction_drive::monitor::register_check::{control, halves};
use virtual_board::Board;
use virtual_board::power_stage::REFERENCE;

use super::{Selection, Without, bounds, run};

const PAGE: &str = include_str!("../../../../docs/safety-evidence.md");
/// `movs r0, #0; bx lr`: a function that detects nothing.
const FINDS_NOTHING: [u8; 4] = [0x00, 0x20, 0x70, 0x47];
const SYSCFG_CFGR2: u32 = 0x4001_001c;
const ECCL: u32 = 1 << 3;
const WWDG_CFR: u32 = 0x4000_2c04;

/// The classes, each with its protection.
const PROTECTED: [(&str, Protection); 8] = [
    ("TIM1 stops", Protection::Window),
    ("core hangs", Protection::Window),
    ("LSI off its frequency", Protection::Sources),
    ("crystal off its frequency", Protection::Sources),
    ("crystal drifts to 4 to 10 % fast", Protection::Sources),
    ("reference voltage off", Protection::Sources),
    ("bit flip in a register", Protection::Registers),
    ("flash ECC in code", Protection::Flash),
];

#[derive(Clone, Copy, PartialEq)]
enum Protection {
    Window,
    Sources,
    Registers,
    Flash,
}

/// Makes a function detect nothing, or restores it from the image.
fn cut(board: &mut Board, function: &str, is_cut: bool) {
    let address = board.image.symbol(function).expect("it is in the image").address;
    let sound = board.image.segments.iter().find_map(|segment| {
        let at = address.checked_sub(segment.address)? as usize;
        segment.bytes.get(at..at + FINDS_NOTHING.len())
    });
    let sound = sound.expect("code of the image").to_vec();
    board.cpu.write(address, if is_cut { &FINDS_NOTHING } else { &sound });
}

/// Makes the check of registers expect the present value of a register.
fn expect_as_it_is(board: &mut Board, address: u32) {
    let table = "induction_drive::task::check::Check::new::{closure#0}::VAR";
    let table = board.image.symbol(table).expect("it is in the image").address;
    for (n, register) in control().enumerate().filter(|(_, r)| r.address == address) {
        let halves = halves(board.chip().read(address, 4) & register.mask);
        board.cpu.write(table + 2 * n as u32, &halves.to_le_bytes());
    }
}

/// Removes the protection of a class, and no other.
fn without(board: &mut Board, class: &str, fault: &str) {
    let (_, protection) = PROTECTED.into_iter().find(|(name, _)| *name == class).expect(class);
    // The comparison of clocks and references; or the interrupt by which an error of the flash ends the run.
    let sources = "induction_drive::task::sources::Sources::measure";
    cut(board, sources, protection == Protection::Sources);
    cut(board, "NonMaskableInt", protection == Protection::Flash);
    match protection {
        Protection::Window if fault.is_empty() => {
            // 128 times slower.
            let config = board.chip().read(WWDG_CFR, 4);
            board.chip().write(WWDG_CFR, 4, config | 7 << 11);
            expect_as_it_is(board, WWDG_CFR);
            board.run_periods(2).expect("it goes on");
        }
        Protection::Registers if !fault.is_empty() => {
            let (_, address) = fault.split_once(" of 0x").expect("a place");
            expect_as_it_is(board, u32::from_str_radix(address, 16).expect("an address"));
        }
        // Also the break by an error of the flash.
        Protection::Flash if !fault.is_empty() => {
            let breaks = board.chip().read(SYSCFG_CFGR2, 4);
            board.chip().write(SYSCFG_CFGR2, 4, breaks & !ECCL);
        }
        _ => {}
    }
}

#[test]
fn a_class_fails_without_its_protection() -> Result<()> {
    let class = PROTECTED.map(|(name, _)| name).join("|");
    // Four of each class: some bits affect nothing, and without the encoder another protection detects a wrong crystal.
    let count = 4 * PROTECTED.len() as u64;
    let both: [Without; 2] = [|_, _, _| (), without];
    let selection = Selection { count, seed: 7000, class, rpm: None };
    let mut tables = run(&REFERENCE, &selection, &both)?;
    let why = tables.remove(1).expect_err("nothing fails without protection").to_string();
    println!("{}", tables.remove(0)?);
    for (class, _) in PROTECTED {
        let failure = why.lines().find(|line| line.starts_with(&format!("{class}, seed ")));
        println!("{}", failure.with_context(|| format!("{class} passes without protection"))?);
    }
    Ok(())
}

/// The table of the page has a row for every class with its bound, and no other rows; at speed the bounds are the same.
#[test]
fn the_page_lists_every_class() {
    let two = |line: &str| line.split(" | ").take(2).collect::<Vec<_>>().join(" | ");
    let rows = PAGE.lines().filter_map(|line| line.strip_prefix("| ")).map(two);
    let rows: Vec<_> = rows.skip_while(|row| !row.starts_with("class |")).skip(1).collect();
    let [at_rest, at_speed] = [false, true].map(|at_speed| {
        let classes = bounds(at_speed);
        classes.lines().skip(2).map(two).collect::<Vec<_>>()
    });
    assert_eq!(rows, at_rest);
    for class in at_speed {
        assert!(rows.contains(&class), "{class}");
    }
}
