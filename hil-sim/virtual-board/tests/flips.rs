//! Flipped bits while the drive is off and in fault: none of them switches a gate on.

use crate::common::pair::Pair;
use anyhow::{Result, ensure};
use drive_core::{Drive, State};
use hil_sim::Config;
use stm32g4_unicorn::cpu::Register;
use virtual_board::addresses::Addresses;
use virtual_board::board::snapshot::Snapshot;
use virtual_board::{Board, Image};

use crate::common;

/// Number of periods after a flip in the directed list: enough for the preparation of a start that a flip requests.
const LONG: u64 = 6000;
/// Number of periods after a flip while the drive is on.
const AFTER: u64 = 300;
/// Number of periods after a flip of any word of the interrupt: an effect without a request appears at once.
const SHORT: u64 = 60;
/// Memory of the trace, which lies after all data of the main loop.
const TRACE: &str = "induction_drive::task::bring_up::start_control::TRACE_MEMORY";

/// Returns a drive that has run with the injection and is at rest: off, and in the fault that ended it.
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

/// Goes back, and flips a bit.
fn flipped(board: &mut Board, to: &Snapshot, at: u32, bit: u32) -> Result<()> {
    board.go_back(to)?;
    let byte = board.cpu.byte(at + bit / 8).unwrap_or(0);
    board.cpu.write(at + bit / 8, &[byte ^ 1 << (bit % 8)]);
    Ok(())
}

/// Returns the words that decide whether the drive is on: the word of the phase, then the number of the fault; the word
/// of the mailbox, then the tag of its command.
fn deciding(board: &Board) -> [u32; 5] {
    let Addresses { orders, order_waits, phase, .. } = board.addresses();
    let mailbox = board.cpu.word(orders).unwrap_or(0);
    [phase, phase + 4, mailbox + order_waits, mailbox, mailbox + 4]
}

/// Flips a bit and continues; fails if a gate is on at any time.
fn flip(board: &mut Board, to: &Snapshot, at: u32, bit: u32, periods: u64) -> Result<()> {
    flipped(board, to, at, bit)?;
    for _ in 0..periods {
        board.run_periods(1)?;
        while board.next_period().is_some() {}
        ensure!(!board.gates().any_on(), "{at:#x}, bit {bit}: a gate is on");
    }
    Ok(())
}

/// A flipped bit switches no gate on, for all bits of the words that decide whether the drive is on: the phase of the
/// drive with the number of its fault, and the mailbox of the commands with the last command in it. Each flip is
/// followed for one second.
#[test]
fn no_bit_of_what_decides_switches_a_gate_on() -> Result<()> {
    for (name, mut pair, kept) in situations()? {
        let board = &mut pair.board;
        let words = deciding(board);
        let word = board.cpu.word(words[0]).unwrap_or(0);
        ensure!(<Drive>::PHASES.contains(&word), "{name}: {word:#x} is no phase");
        for at in words {
            for bit in 0..32 {
                flip(board, &kept, at, bit, LONG)?;
            }
        }
        println!("{name}: {} bits", 32 * words.len());
    }
    Ok(())
}

/// The same bits in each phase that has outputs: the drive continues unchanged, or is off.
#[test]
fn no_bit_of_what_decides_leads_to_another_phase() -> Result<()> {
    let ways = [
        ("start torque", State::Precharge),
        ("start torque", State::Magnetising),
        ("start torque", State::Torque),
        ("start learning", State::Learning),
        ("start vf", State::VoltsPerHertz),
    ];
    for (order, state) in ways {
        let mut pair = common::pair(&Config::default(), 61)?;
        pair.order(order)?;
        pair.until_state(state)?;
        pair.board.forgive();
        let (kept, board) = (pair.board.keep()?, &mut pair.board);
        board.run_periods(AFTER)?;
        let words = deciding(board);
        let goes_on = board.cpu.word(words[0]);
        let mut off = 0;
        for at in words {
            for bit in 0..32 {
                flipped(board, &kept, at, bit)?;
                board.run_periods(AFTER)?;
                let phase = board.cpu.word(words[0]);
                // (A word that is no phase ends the program.)
                let is_on = phase.is_some_and(|phase| <Drive>::PHASES[2..].contains(&phase));
                let is_off = !is_on && !board.gates().any_on();
                ensure!(is_off || phase == goes_on, "{state}: {at:#x}, bit {bit}: {phase:x?}");
                off += u32::from(is_off);
            }
        }
        println!("{state}: {} bits, {off} of them switched it off", 32 * words.len());
    }
    Ok(())
}

/// Each bit of the interrupt's own data besides the drive: its data on timer, ADCs and reports.
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

/// Each bit of the drive's state and of the main loop: its stack, and all static data except the interrupt's and the trace. A drive that
/// is off or in a fault starts by nothing but an order, which changes its phase in the next period. So each flip is followed until the
/// main loop has passed several times. If the phase has changed then, a second must pass without a gate on.
#[test]
#[ignore = "half an hour: `cargo xtask prove image`"]
fn no_bit_of_drive_and_main_loop_switches_a_gate_on() -> Result<()> {
    let trace = Image::built()?.symbol(TRACE)?.address;
    for (name, mut pair, kept) in situations()? {
        let board = &mut pair.board;
        let (state, phase) = (board.addresses().state, board.addresses().phase);
        let was = board.cpu.word(phase);
        let main_loop = board.cpu.get(Register::SP) & !3..trace;
        let words = (state.address..state.end()).step_by(4).chain(main_loop.step_by(4));
        let (mut bits, mut others) = (0, 0);
        for (at, bit) in words.flat_map(|at| (0..32).map(move |bit| (at, bit))) {
            flip(board, &kept, at, bit, SHORT)?;
            bits += 1;
            if board.cpu.word(phase) != was {
                others += 1;
                flip(board, &kept, at, bit, LONG)?;
            }
        }
        println!("{name}: {bits} bits, {others} of them changed the phase");
    }
    Ok(())
}
