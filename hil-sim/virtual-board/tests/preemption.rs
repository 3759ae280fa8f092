//! Code that the control interrupt preempts continues undisturbed.

use crate::common::pair::Pair;
use anyhow::{Context, Result};
use drive_core::State;
use hil_sim::Config;
use induction_drive::board::CYCLES_PER_US;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use virtual_board::board::CONTROL_INTERRUPT;
use virtual_board::board::poison::Poison;
use virtual_board::{Counting, Image, Options};

/// Number of control interrupts that are checked.
const INTERRUPTS: u64 = 100_000;
/// Number of periods in which the log writes at least two lines.
const LOGGED: u64 = 12_100;
/// Largest number of instructions between two requested interrupts.
const APART: u64 = 3000;

/// Latest start of the control interrupt here, ticks: 1 us. The firmware may be late by 10 us
/// (`board::LATEST_START_US`). Here an instruction in the flash takes one cycle, on the chip up to five, and a factor
/// of two is left for effects that are not modelled.
const LATEST_START: u64 = CYCLES_PER_US as u64;

/// Main loop and serial interrupt are preempted before any instruction, by the interrupts of the ADCs and by others
/// that are requested at random, a hundred thousand in all, while the drive regulates and the console is busy.
/// Registers and stack are compared after each, with the floating-point registers poisoned inside; the log is complete.
/// No interrupt waits for the code that it preempts.
#[test]
fn a_hundred_thousand_interrupts_start_at_once_and_leave_registers_stack_and_log_intact()
-> Result<()> {
    let mut options = Options::new(&Config::default(), 5);
    options.counting = Counting { cycles: true, every_instruction: true };
    let mut pair = Pair::new(Image::built()?, options)?;
    // Without tags, as a person types: the seed below belongs to these instants.
    for line in ["log debug", "start torque"] {
        pair.run(120, |_, _| {})?;
        pair.board.take_console();
        pair.board.type_line(line);
        pair.shadow.type_line(line);
        pair.until("an answer", 30_000, |pair, _| pair.board.take_console().ends_with('\n'))?;
    }
    pair.until_state(State::Torque)?;
    let mut board = pair.board;
    board.take_log()?;
    board.poison = Some(Poison::new(board.image.symbol("_stack_start")?.address));
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(6);
    let (mut periods, mut replies) = (0_u64, 0);
    while periods < LOGGED || board.poison.as_ref().is_some_and(|poison| poison.intact < INTERRUPTS)
    {
        board.stop_after(rng.random_range(1..APART));
        board.run_ticks(2000)?;
        board.pend(CONTROL_INTERRUPT);
        while board.next_period().is_some() {
            periods += 1;
            if periods.is_multiple_of(150) {
                board
                    .type_line(["status", "get motor.r_s", "faults"][rng.random_range(0..3_usize)]);
                replies += 1;
            }
        }
    }
    let heard = board.take_console();
    assert!(!heard.contains("last run: reset by software"), "the firmware has restarted: {heard}");
    let lines = heard.lines().count();
    assert!(heard.lines().all(|line| !line.starts_with("error")), "{heard}");
    assert!(lines + 5 > replies, "{lines} answers to {replies} lines");
    let log = board.take_log()?;
    assert!(log.iter().all(|line| !line.contains("malformed")), "{log:#?}");
    // One line per second.
    assert!(log.len() as u64 >= periods / 6000, "{} lines in {periods} periods", log.len());
    let mut latest =
        heard.lines().rev().filter_map(|line| line.split_once("latest start ")?.1.split_once(' '));
    let told: f64 = latest.next().context("no status")?.0.parse()?;
    let seen = board.latest_start;
    println!("the latest start {seen} cycles after it was asked for; {told} us by the status");
    assert!(seen <= LATEST_START, "{seen} cycles");
    // By the firmware's own measurement, with one decimal: twice the bound, for interrupts that wait for one that was
    // requested in vain.
    let bound = 2.0 * LATEST_START as f64 / f64::from(CYCLES_PER_US);
    assert!(told <= bound, "{told} us by the status");
    let floating = board.poison.as_ref().map_or(0, |poison| poison.in_floating_point);
    println!(
        "{periods} periods, {floating} interrupts in code with floating point, {lines} answers"
    );
    Ok(())
}
