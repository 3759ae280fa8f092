//! Flipped bits while the drive is off and in fault: none of them switches a gate on.

use anyhow::{Result, ensure};
use drive_core::{Drive, State};
use virtual_board::board::snapshot::Snapshot;
use virtual_board::{Board, Pair};

use crate::common;

/// Periods behind a flip of the directed list: a start that a flip orders is through its preparation.
const LONG: u64 = 6000;
/// Periods behind a flip of any word of the interrupt: what acts without an order acts at once.
const SHORT: u64 = 60;

/// A drive that has run with the injection and rests: off, and in the fault that ended it.
fn situations() -> Result<[(&'static str, Pair, Snapshot); 2]> {
    let mut off = common::regulating(61)?;
    off.order("stop")?;
    off.until_state(State::Off)?;
    off.run(1200, |_, _| {})?;
    let mut fault = common::regulating(61)?;
    fault.board.set_fault_pin(false);
    fault.run(600, |_, _| {})?;
    fault.board.set_fault_pin(true);
    fault.run(600, |_, _| {})?;
    // A wild access is a fault of the processor, as on the chip.
    off.board.forgive();
    fault.board.forgive();
    let (a, b) = (off.board.keep()?, fault.board.keep()?);
    Ok([("off", off, a), ("fault", fault, b)])
}

/// Flips a bit, and goes on; an error if a gate is on at any time.
fn flip(board: &mut Board, to: &Snapshot, at: u32, bit: u32, periods: u64) -> Result<()> {
    board.go_back(to)?;
    let byte = board.cpu.byte(at + bit / 8).unwrap_or(0);
    board.cpu.write(at + bit / 8, &[byte ^ 1 << (bit % 8)]);
    for _ in 0..periods {
        board.run_periods(1)?;
        while board.next_period().is_some() {}
        ensure!(!board.gates().any_on(), "{at:#x}, bit {bit}: a gate is on");
    }
    Ok(())
}

/// A flipped bit switches no gate on, whichever bit it is of the words that decide whether the drive is on: the phase of the drive with the
/// number of its fault, and the mailbox of the commands with the last command in it. Each flip is followed for one second.
#[test]
fn no_bit_of_what_decides_switches_a_gate_on() -> Result<()> {
    for (name, mut pair, kept) in situations()? {
        let board = &mut pair.board;
        let addresses = board.addresses();
        let mailbox = board.cpu.word(addresses.orders).unwrap_or(0);
        let phase = addresses.phase;
        let word = board.cpu.word(phase).unwrap_or(0);
        ensure!(Drive::PHASES.contains(&word), "{name}: {word:#x} is no phase");
        // The word of the phase, then the number of the fault; the word of the mailbox, then the tag of its command.
        let words = [phase, phase + 4, mailbox + addresses.order_waits, mailbox, mailbox + 4];
        for at in words {
            for bit in 0..32 {
                flip(board, &kept, at, bit, LONG)?;
            }
        }
        println!("{name}: {} bits", 32 * words.len());
    }
    Ok(())
}

/// Each bit of the interrupt's own data beside the drive: what it knows of timer, converters and reports.
#[test]
fn no_bit_of_the_interrupt_switches_a_gate_on() -> Result<()> {
    for (name, mut pair, kept) in situations()? {
        let board = &mut pair.board;
        let addresses = board.addresses();
        let drive = addresses.coefficients.address..addresses.state.end();
        let words = (addresses.control.address..addresses.control.end()).step_by(4);
        let words: Vec<_> = words.filter(|at| !drive.contains(at)).collect();
        for at in &words {
            for bit in 0..32 {
                flip(board, &kept, *at, bit, SHORT)?;
            }
        }
        println!("{name}: {} bits", 32 * words.len());
    }
    Ok(())
}

/// Each bit of the drive, a second each.
#[test]
#[ignore = "an hour: `cargo xtask prove image`"]
fn no_bit_of_the_drive_switches_a_gate_on() -> Result<()> {
    for (name, mut pair, kept) in situations()? {
        let board = &mut pair.board;
        let state = board.addresses().state;
        for at in (state.address..state.end()).step_by(4) {
            for bit in 0..32 {
                flip(board, &kept, at, bit, LONG)?;
            }
        }
        println!("{name}: {} bits", 8 * state.size);
    }
    Ok(())
}
