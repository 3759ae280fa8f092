//! Cycles of the control interrupt by block, on the longest path of whole runs: from its entry to the last compare
//! value, and of the whole interrupt. Also the cycles of the states that run from the flash, and those of a control
//! period in the identification.
//!
//! A block is a part of [`drive_core::Drive::step`]. An instruction belongs to the outermost function around it,
//! including inlined ones, that is in a block.

use std::collections::BTreeMap;
use std::env;

use anyhow::{Context, Result, bail, ensure};
use drive_core::State;
use hil_sim::{Config, config::LoadMode};
use induction_drive::board::{LONGEST_INTERRUPT_CYCLES, WAIT_STATES};
use stm32g4_unicorn::chip::Watched;
use stm32g4_unicorn::cost::{self, BUS, TAKEN, instructions};
use stm32g4_unicorn::memory;
use virtual_board::board::{LongestPath, TICKS_PER_PERIOD};
use virtual_board::{Board, Image, Options, Period};

use crate::common::pair::Pair;

/// Blocks, and parts of the paths of the functions that belong to them, separated by spaces; the first match applies.
const BLOCKS: [(&str, &str); 12] = [
    ("sensing", "drive_core::front_end chip::adc chip::encoder"),
    ("protection", "Coefficients>::protect protect::plausibility protect::lock_monitor"),
    ("injection", "carrier::injection protect::saliency_check"),
    ("observer", "Coefficients>::observe_fundamental flux::observer flux::hand_over"),
    ("limits", "current::voltage_limit"),
    ("tracker", "flux::tracker"),
    ("estimator", "flux::estimator carrier::synchronous flux::schedule flux::indirect"),
    ("current loop", "current::pi"),
    ("modulation", "current::modulation current::dead_time"),
    ("frames, filters", "math::frames filter::sos math::angle idsp::"),
    ("identification", "rotor_id::online rotor_id::rls"),
    ("sequence", "induction_drive_core::drive induction_drive_core::motion"),
];
/// The block of instructions outside all others: the timer.
const REST: &str = "firmware";
/// Exception entry including its saving of registers, waiting for the bus of the peripherals, and waiting for the flash.
const OVERHEAD: [&str; 3] = ["exception", "bus", "flash"];

/// Core cycles in a control period.
const PERIOD: u32 = TICKS_PER_PERIOD as u32;
/// Largest number of cycles of an interrupt in the states that run from the flash, including a start: the limit of the window watchdog.
const COLD: u32 = LONGEST_INTERRUPT_CYCLES;

/// The function of the main loop that passes a control period to the identification.
const IDENTIFICATION: &str = "induction_drive_rotor_id::online::Online::sample";
/// Number of control periods for which it is observed, three seconds: the filters settle within one.
const WATCHED_PERIODS: u64 = 18_000;

/// A row of the table.
#[derive(Clone, Debug, Default, PartialEq)]
struct Row {
    /// `sensored` or `sensorless`: the control interrupt. `identification`: a control period in the main loop; the
    /// longest contains a sample of the recursive least squares, the median does not.
    name: &'static str,
    /// Instructions on the longest path to the last compare value.
    instructions: u32,
    /// Estimated cycles on that path.
    cycles: u32,
    /// Median of the estimated cycles to the last compare value while the drive regulates.
    median: u32,
    /// Estimated cycles of the longest interrupt, including report, trace and requests after the compare values.
    whole: u32,
    /// Largest number of cycles to the last compare value in each of the ten samples of an injection period.
    by_turn: [u32; 10],
    /// Cycles by block.
    blocks: BTreeMap<&'static str, u32>,
}

/// Runs whole scenarios on the board: start, magnetising, torque steps, a reversal, the current limit, stop, with a
/// busy console.
///
/// # Errors
/// The board cannot continue, or its results differ from those of the host; or a path of a block matches no function.
fn measure() -> Result<Vec<Row>> {
    let image = Image::built;
    check_paths(&image()?)?;
    let mut rows = vec![sensored(image()?)?, sensorless(image()?)?, identification(image()?)?];
    for scene in COLD_SCENES {
        rows.push(cold(image()?, scene)?);
    }
    Ok(rows)
}

/// The budgets are the variables `TO_LAST_COMPARE` and `WHOLE`, cycles.
#[test]
#[ignore = "needs the budgets; cargo xtask cycles runs it"]
fn the_control_interrupt_keeps_its_budgets() -> Result<()> {
    let budget = |name| anyhow::Ok(env::var(name).context(name)?.parse()?);
    let rows = measure()?;
    print!("{}", table(&rows));
    check(&rows, budget("TO_LAST_COMPARE")?, budget("WHOLE")?)
}

/// Lines at the console that lead through states whose code is in the flash, and the load of the shaft.
const COLD_SCENES: [(&str, &[&str], LoadMode); 4] = [
    ("start, turning", &["start torque", "torque 1"], LoadMode::Speed),
    ("V/f", &["start vf", "speed 600"], LoadMode::Free),
    ("learning", &["learn"], LoadMode::Locked),
    ("commissioning", &["commission"], LoadMode::Locked),
];
/// Speed of the rotating shaft, rpm.
const TURNING_RPM: f64 = 900.0;
/// Control periods after each of these lines: three seconds.
const COLD_PERIODS: u64 = 18_000;

/// Runs the scene and measures the longest interrupt in it.
fn cold(image: Image, (name, lines, load): (&'static str, &[&str], LoadMode)) -> Result<Row> {
    let mut config = Config::default();
    (config.load.mode, config.load.speed_rpm) = (load, TURNING_RPM);
    let mut board = Board::new(image, Options::new(&config, 1))?;
    while !board.take_console().ends_with('\n') {
        board.run_periods(10)?;
    }
    board.longest = LongestPath::default();
    let mut cycles = Vec::new();
    for line in lines {
        board.type_line(line);
        board.run_periods(COLD_PERIODS)?;
        while let Some(period) = board.next_period() {
            cycles.push(in_turn(&period));
        }
    }
    ensure!(board.chip().tim1.outputs_on(), "{name}: the outputs are off");
    let path = std::mem::take(&mut board.longest);
    row(name, &board, &path, cost::ENTRY + cost::EXIT, cycles, path.cycles)
}

/// Returns the number of a control period and its cycles to the last compare value. Periods between the measured ones count as well.
fn in_turn(period: &Period) -> (usize, u32) {
    ((period.began / TICKS_PER_PERIOD) as usize, period.to_compares)
}

/// Checks that each path of the blocks matches a function.
///
/// # Errors
/// The paths that match nothing in the image.
fn check_paths(image: &Image) -> Result<()> {
    let mut unmatched: Vec<&str> = BLOCKS.iter().flat_map(|(_, paths)| paths.split(' ')).collect();
    for address in image.code() {
        let frames = image.frames(address);
        unmatched.retain(|path| !frames.iter().any(|frame| frame.function.contains(path)));
        if unmatched.is_empty() {
            return Ok(());
        }
    }
    bail!("the image has no function with these paths: {}", unmatched.join(", "))
}

/// Runs the drive with tracking of the rotor time constant.
fn identification(image: Image) -> Result<Row> {
    let watched = Watched::new(image.symbol(IDENTIFICATION)?);
    let mut pair = Pair::new(image, Options::new(&Config::default(), 1))?;
    for line in ["angle encoder", "set track_rotor yes", "start torque"] {
        pair.order(line)?;
    }
    pair.until_state(State::Torque)?;
    pair.order("torque 1.5")?;
    pair.board.chip().watched = Some(watched);
    pair.run(WATCHED_PERIODS, |_, _| {})?;
    let watched = pair.board.chip().watched.take().context("not watched")?;
    let cycles = watched.calls.iter().max().copied().unwrap_or(0);
    let path = LongestPath { cycles, accesses: 0, blocks: watched.longest };
    let calls = watched.calls.into_iter().enumerate().collect();
    row("identification", &pair.board, &path, 0, calls, cycles)
}

fn sensorless(image: Image) -> Result<Row> {
    let mut pair = Pair::new(image, Options::new(&Config::default(), 1))?;
    pair.start_torque()?;
    let orders = ["torque 1", "torque 2", "torque -2", "torque 9", "torque 0"];
    regulate(&mut pair, "sensorless", &orders)
}

fn sensored(image: Image) -> Result<Row> {
    let mut config = Config::default();
    config.load.mode = LoadMode::Free;
    let mut pair = Pair::new(image, Options::new(&config, 1))?;
    pair.order("angle encoder")?;
    pair.order("start position")?;
    pair.until_state(State::Position)?;
    regulate(&mut pair, "sensored", &["position 2", "position -1", "position 0"])
}

/// Sends the requests, one per second, and measures the run from its start to off.
fn regulate(pair: &mut Pair, name: &'static str, orders: &[&str]) -> Result<Row> {
    let mut cycles = Vec::new();
    // Without the time before, because configuring a drive that is off may take any number of cycles.
    pair.board.longest = LongestPath::default();
    pair.board.longest_to_compares = LongestPath::default();
    for line in orders {
        // The drive accepts the request, or limits it.
        pair.ask(line)?;
        pair.board.type_line("trace 500 2");
        pair.run(6000, |_, period| cycles.push(in_turn(period)))?;
    }
    pair.board.send(b"\n");
    pair.run(60, |_, _| {})?;
    pair.ask("stop")?;
    pair.until_state(State::Off)?;
    let whole = pair.board.longest.cycles;
    let path = std::mem::take(&mut pair.board.longest_to_compares);
    row(name, &pair.board, &path, cost::ENTRY, cycles, whole)
}

/// Returns the row of a path that was entered in `entry` cycles; `all` holds the cycles of all calls.
fn row(
    name: &'static str,
    board: &Board,
    path: &LongestPath,
    entry: u32,
    all: Vec<(usize, u32)>,
    whole: u32,
) -> Result<Row> {
    let mut by_turn = [0; 10];
    for (n, cycles) in &all {
        by_turn[n % 10] = by_turn[n % 10].max(*cycles);
    }
    let mut all: Vec<u32> = all.into_iter().map(|(_, cycles)| cycles).collect();
    all.sort_unstable();
    let median = *all.get(all.len() / 2).context("nothing was counted")?;
    let blocks = BTreeMap::from([(OVERHEAD[0], entry), (OVERHEAD[1], path.accesses * BUS)]);
    let cycles = path.cycles;
    let mut row = Row { name, cycles, median, whole, by_turn, blocks, ..Row::default() };
    let mut places: BTreeMap<u32, &'static str> = BTreeMap::new();
    for block in &path.blocks {
        let mut code = vec![0; block.size as usize];
        board.cpu.read(block.address, &mut code);
        let mut list: Vec<_> = instructions(&code).collect();
        if let (true, Some(last)) = (block.taken, list.last_mut()) {
            last.cycles += TAKEN;
        }
        // The identification is counted as if the flash had no wait states, because interrupts come in between.
        if entry > 0 && block.address < memory::CCM {
            let waits = cost::waits(block.address, block.size, WAIT_STATES.into());
            *row.blocks.entry(OVERHEAD[2]).or_default() += waits;
        }
        for instruction in list {
            let at = block.address + instruction.offset;
            let block = *places.entry(at).or_insert_with(|| block_of(&board.image, at));
            *row.blocks.entry(block).or_default() += instruction.cycles;
            row.instructions += 1;
        }
    }
    let cycles: u32 = row.blocks.values().sum();
    ensure!(cycles == path.cycles, "{cycles} cycles by blocks, but {} counted", path.cycles);
    Ok(row)
}

/// Returns the block of an instruction.
fn block_of(image: &Image, address: u32) -> &'static str {
    let frames = image.frames(address);
    // From the outermost function inwards; functions that no other block claims belong to the sequence.
    let (named, sequence) = BLOCKS.split_at(BLOCKS.len() - 1);
    let find = |blocks: &[(&'static str, &str)]| {
        frames.iter().rev().find_map(|frame| {
            let matches = |path: &str| frame.function.contains(path);
            blocks.iter().find(|(_, paths)| paths.split(' ').any(matches)).map(|b| b.0)
        })
    };
    find(named).or_else(|| find(sequence)).unwrap_or(REST)
}

/// Checks the rows against these budgets of the control interrupt, cycles: to the last compare value, and whole. A
/// state that runs from the flash may take as long as the window watchdog allows.
///
/// # Errors
/// The row that exceeds a budget, and the budget.
fn check(rows: &[Row], to_compares: u32, whole: u32) -> Result<()> {
    for row in rows {
        let name = row.name;
        let (to_compares, whole) =
            if row.blocks.contains_key(OVERHEAD[2]) { (COLD, COLD) } else { (to_compares, whole) };
        ensure!(row.whole <= whole, "{name}: {} cycles, {whole} allowed", row.whole);
        ensure!(
            row.cycles <= to_compares,
            "{name}: {} cycles to the last compare value, {to_compares} allowed",
            row.cycles
        );
    }
    Ok(())
}

/// Returns the rows as a table; the share is that of the whole interrupt in the control period.
fn table(rows: &[Row]) -> String {
    let blocks = || BLOCKS.iter().map(|block| block.0).chain([REST]).chain(OVERHEAD);
    let mut text = format!(
        "{:<16}{:>14}{:>8}{:>8}{:>8}{:>8}",
        "line", "instructions", "cycles", "median", "whole", "share"
    );
    text.extend(blocks().map(|block| format!("{block:>17}")));
    for row in rows {
        let (i, c, m, w) = (row.instructions, row.cycles, row.median, row.whole);
        let share = 100.0 * f64::from(w) / f64::from(PERIOD);
        text += &format!("\n{:<16}{i:>14}{c:>8}{m:>8}{w:>8}{share:>6.1} %", row.name);
        let cycles = |block| row.blocks.get(block).copied().unwrap_or(0);
        text.extend(blocks().map(|block| format!("{:>17}", cycles(block))));
    }
    text += "\n\nto the last compare value, by sample of the injection period";
    for row in rows {
        let turns = row.by_turn.map(|cycles| format!("{cycles:>6}")).concat();
        text += &format!("\n{:<16}{turns}", row.name);
    }
    text + "\n"
}

#[test]
fn an_interrupt_above_a_budget_is_refused_by_its_figure() {
    let refused = |cycles, whole, from_flash: bool| {
        let mut blocks = BTreeMap::new();
        if from_flash {
            blocks.insert("flash", 100);
        }
        let (name, by_turn) = ("x", [0; 10]);
        let row = Row { name, instructions: 0, cycles, median: 0, whole, by_turn, blocks };
        check(&[row], 2650, 3700).err().map(|why| why.to_string())
    };
    assert_eq!(refused(2650, 3700, false), None);
    assert!(
        refused(2650, 3701, false).is_some_and(|why| why.contains("3701 cycles, 3700 allowed"))
    );
    assert!(refused(2651, 3700, false).is_some_and(|w| w.contains("2651") && w.contains("2650")));
    // States that run from the flash may take as long as the window watchdog allows.
    let most = COLD;
    assert_eq!(refused(most, most, true), None);
    assert!(refused(most, most + 1, true).is_some_and(|why| why.contains("12001")));
}
