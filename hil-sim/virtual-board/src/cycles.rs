//! What the control interrupt costs, block by block: its longest way over whole runs, from its entry to the
//! compare values, and the whole of it; and what a sample of the identification costs.
//!
//! A block is what [`drive_core::Drive::step`] is made of; an instruction belongs to the outermost of the
//! functions it was inlined into that is one of them.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::{Context, Result, bail};
use drive_core::State;
use hil_sim::Config;
use hil_sim::config::LoadMode;

use crate::board::{Options, Worst};
use crate::chip::Watched;
use crate::cost::{self, BUS, TAKEN, instructions};
use crate::image::Image;
use crate::pair::Pair;

/// Blocks, and the paths of functions that belong to them; the first that fits counts.
const BLOCKS: [(&str, &[&str]); 10] = [
    (
        "sensing",
        &[
            "drive_core::current::sensing",
            "induction_drive::chip::adc",
            "induction_drive::chip::encoder",
        ],
    ),
    (
        "protection",
        &[
            "Drive>::protect",
            "drive_core::protect::plausibility",
            "drive_core::protect::lock_monitor",
        ],
    ),
    ("injection", &["drive_core::carrier::injection", "drive_core::protect::saliency_check"]),
    ("tracker", &["drive_core::flux::tracker"]),
    (
        "estimator",
        &[
            "drive_core::flux::estimator",
            "drive_core::carrier::synchronous",
            "drive_core::carrier::demodulator",
            "drive_core::flux::schedule",
            "drive_core::flux::indirect",
            "drive_core::position",
        ],
    ),
    ("current loop", &["drive_core::current::pi"]),
    ("modulation", &["drive_core::current::modulation", "drive_core::current::dead_time"]),
    (
        "frames, filters",
        &[
            "drive_core::math::frames",
            "drive_core::filter::dissertation",
            "drive_core::filter::sos",
            "drive_core::math::angle",
            "idsp::",
        ],
    ),
    ("identification", &["drive_core::identify::online", "drive_core::identify::rls"]),
    ("sequence", &["drive_core::drive", "drive_core::motion"]),
];
/// What belongs to none: the timer.
const REST: &str = "firmware";
/// Entry and registers; and waiting for the bus of the peripherals.
const ENTRY: [&str; 2] = ["exception", "bus"];
/// How much a line of the table may rise before it is refused.
const TOLERANCE: f64 = 1.05;

/// The function of the main loop that takes a control period into the identification.
const IDENTIFICATION: &str = "6Online6sample";

/// Periods that are watched, three seconds: the filters settle within one.
const IDENTIFIED: u64 = 18_000;

/// A line of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// `sensored` or `sensorless`: the control interrupt; `identification`: a control period in the main
    /// loop, the longest with a sample of the recursive least squares in it, the median without.
    pub name: &'static str,
    /// Instructions on the longest way to the compare values.
    pub instructions: u32,
    /// Estimated cycles of it.
    pub cycles: u32,
    /// Estimated cycles of the one in the middle of all while the drive regulates.
    pub median: u32,
    /// Estimated cycles of the longest interrupt, with what comes after the compare values: report, trace,
    /// orders.
    pub whole: u32,
    /// Cycles by block.
    pub blocks: BTreeMap<&'static str, u32>,
    /// Cycles by block and innermost function.
    pub functions: BTreeMap<(&'static str, String), u32>,
}

/// Runs whole scenarios on the board: start, magnetising, torque steps, a reversal, the current limit, stop,
/// with the console busy.
///
/// # Errors
/// The board cannot go on, or does not compute what the host computes.
pub fn measure(image: impl Fn() -> Result<Image>) -> Result<[Line; 3]> {
    Ok([sensored(image()?)?, sensorless(image()?)?, identification(image()?)?])
}

/// Runs the drive with the rotor time constant tracked.
fn identification(image: Image) -> Result<Line> {
    let watched = Watched::new(image.symbol(IDENTIFICATION)?);
    let mut pair = Pair::new(image, Options::new(&Config::default(), 1))?;
    for line in ["angle encoder", "set track_rotor yes", "start torque"] {
        pair.order(line)?;
    }
    pair.until_state(State::Torque)?;
    pair.order("torque 1.5")?;
    pair.board.chip().watched = Some(watched);
    pair.run(IDENTIFIED, |_, _| {})?;
    let watched = pair.board.chip().watched.take().context("not watched")?;
    let mut cycles = watched.calls;
    let worst = cycles.iter().max().copied().unwrap_or(0);
    let worst = Worst { cycles: worst, accesses: 0, blocks: watched.longest };
    let median = middle(&mut cycles)?;
    line("identification", &pair, (&worst, 0), median, worst.cycles)
}

/// The one in the middle.
fn middle(cycles: &mut [u32]) -> Result<u32> {
    cycles.sort_unstable();
    cycles.get(cycles.len() / 2).copied().context("nothing was counted")
}

fn sensorless(image: Image) -> Result<Line> {
    let mut pair = Pair::new(image, Options::new(&Config::default(), 1))?;
    pair.order("start torque")?;
    pair.until_state(State::Torque)?;
    regulate(
        &mut pair,
        "sensorless",
        &["torque 1", "torque 2", "torque -2", "torque 9", "torque 0"],
    )
}

fn sensored(image: Image) -> Result<Line> {
    let mut config = Config::default();
    config.load.mode = LoadMode::Free;
    let mut pair = Pair::new(image, Options::new(&config, 1))?;
    pair.order("angle encoder")?;
    pair.order("start position")?;
    pair.until_state(State::Position)?;
    regulate(&mut pair, "sensored", &["position 2", "position -1", "position 0"])
}

/// Gives the orders, a second each, and judges the run from its start to off.
fn regulate(pair: &mut Pair, name: &'static str, orders: &[&str]) -> Result<Line> {
    let mut cycles = Vec::new();
    // From here on: while the drive was off, it was configured, which has all the time there is.
    pair.board.worst = Worst::default();
    pair.board.worst_to_compares = Worst::default();
    for line in orders {
        // Accepted, or taken as far as the limits allow.
        pair.say(line)?;
        pair.board.type_line("trace 500 2");
        pair.run(6000, |_, period| cycles.push(period.to_compares))?;
    }
    pair.board.send(b"\n");
    pair.run(60, |_, _| {})?;
    pair.say("stop")?;
    pair.until_state(State::Off)?;
    let median = middle(&mut cycles)?;
    let whole = pair.board.worst.cycles;
    let worst = std::mem::take(&mut pair.board.worst_to_compares);
    line(name, pair, (&worst, cost::ENTRY), median, whole)
}

fn pair_read(pair: &Pair, address: u32, bytes: &mut [u8]) {
    for (n, byte) in bytes.iter_mut().enumerate() {
        let at = address + n as u32;
        let word = pair.board.word(at & !3).unwrap_or(0);
        *byte = (word >> (8 * (at & 3))) as u8;
    }
}

/// The line of a longest way that was entered by so many cycles.
fn line(
    name: &'static str,
    pair: &Pair,
    way: (&Worst, u32),
    median: u32,
    whole: u32,
) -> Result<Line> {
    let (instructions, (blocks, functions)) =
        attribute(pair.board.image(), way, |address, bytes| pair_read(pair, address, bytes))?;
    Ok(Line { name, instructions, cycles: way.0.cycles, median, whole, blocks, functions })
}

/// Cycles by block, and by block and innermost function.
type Shares = (BTreeMap<&'static str, u32>, BTreeMap<(&'static str, String), u32>);

/// Instructions of a way, and what belongs to what.
fn attribute(
    image: &Image,
    (worst, entry): (&Worst, u32),
    read: impl Fn(u32, &mut [u8]),
) -> Result<(u32, Shares)> {
    let mut blocks = BTreeMap::from([(ENTRY[0], entry), (ENTRY[1], worst.accesses * BUS)]);
    let mut functions = BTreeMap::new();
    let mut belongs: BTreeMap<u32, (&'static str, String)> = BTreeMap::new();
    let mut count = 0;
    for block in &worst.blocks {
        let mut code = vec![0; block.size as usize];
        read(block.address, &mut code);
        let mut list: Vec<_> = instructions(&code).collect();
        if let (true, Some(last)) = (block.taken, list.last_mut()) {
            last.cycles += TAKEN;
        }
        for instruction in list {
            let at = block.address + instruction.offset;
            let place = belongs.entry(at).or_insert_with(|| block_of(image, at));
            *blocks.entry(place.0).or_default() += instruction.cycles;
            *functions.entry(place.clone()).or_default() += instruction.cycles;
            count += 1;
        }
    }
    let cycles: u32 = blocks.values().sum();
    if cycles != worst.cycles {
        bail!("{cycles} cycles by blocks, but {} counted", worst.cycles);
    }
    Ok((count, (blocks, functions)))
}

/// The block of an instruction, and the innermost function it is of.
fn block_of(image: &Image, address: u32) -> (&'static str, String) {
    let frames = image.frames(address);
    // From the outermost inwards; what no other block claims is the sequence's.
    let (named, sequence) = BLOCKS.split_at(BLOCKS.len() - 1);
    let find = |blocks: &[(&'static str, &[&str])]| {
        frames.iter().rev().find_map(|frame| {
            let fits = |part: &&str| frame.function.contains(*part);
            blocks.iter().find(|(_, parts)| parts.iter().any(fits)).map(|b| b.0)
        })
    };
    let block = find(named).or_else(|| find(sequence)).unwrap_or(REST);
    (block, frames.first().map_or_else(String::new, |frame| frame.function.clone()))
}

/// The lines as a table.
pub fn table(lines: &[Line]) -> String {
    let blocks = || BLOCKS.iter().map(|block| block.0).chain([REST]).chain(ENTRY);
    let mut text =
        format!("{:<16}{:>14}{:>8}{:>8}{:>8}", "line", "instructions", "cycles", "median", "whole");
    blocks().for_each(|block| {
        let _ = write!(text, "{block:>17}");
    });
    text.push('\n');
    for line in lines {
        let (i, c, m, w) = (line.instructions, line.cycles, line.median, line.whole);
        let _ = write!(text, "{:<16}{i:>14}{c:>8}{m:>8}{w:>8}", line.name);
        for block in blocks() {
            let _ = write!(text, "{:>17}", line.blocks.get(block).copied().unwrap_or(0));
        }
        text.push('\n');
    }
    text
}

/// What every function of every block takes on the longest path, the largest first.
pub fn functions(line: &Line) -> String {
    let mut list: Vec<_> = line.functions.iter().collect();
    list.sort_by_key(|(_, cycles)| std::cmp::Reverse(**cycles));
    list.iter().fold(String::new(), |mut text, ((block, function), cycles)| {
        let _ = writeln!(text, "{:<16}{cycles:>6} {block:<16} {function}", line.name);
        text
    })
}

/// Compares with a table that [`table`] wrote before.
///
/// # Errors
/// A line needs over 5 % more instructions or cycles than it did, or is not there.
pub fn compare(lines: &[Line], before: &str) -> Result<()> {
    for line in lines {
        let words: Vec<&str> = before
            .lines()
            .map(|text| text.split_whitespace().collect::<Vec<_>>())
            .find(|words| words.first() == Some(&line.name))
            .with_context(|| format!("the table has no line {}", line.name))?;
        for (what, place, now) in [
            ("instructions", 1, line.instructions),
            ("cycles", 2, line.cycles),
            ("whole", 4, line.whole),
        ] {
            let was: u32 = words.get(place).context("the table is cut off")?.parse()?;
            if f64::from(now) > TOLERANCE * f64::from(was) {
                bail!("{}: {now} {what}, {was} before: more than 5 % more", line.name);
            }
        }
    }
    Ok(())
}
