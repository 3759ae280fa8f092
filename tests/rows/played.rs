//! Plays the rows of `rows.txt` for the tests of several packages, each of which includes this file and has a bench of its own.

use std::ops::RangeInclusive;

use drive_core::State;
use hil_sim::plant::{Load, Plant};
use hil_sim::rig::RATE_HZ;

/// Names of the quantities with bounds.
const QUANTITIES: [&str; 3] = ["angle_error_deg", "turns", "current_a"];
/// Their values in a period.
pub type Seen = [f64; QUANTITIES.len()];
/// Longest wait for a state, s.
const LONGEST_S: f64 = 30.0;

/// A procedure.
pub struct Row {
    pub name: &'static str,
    /// Changes of the configuration, `key=value`.
    pub changes: Vec<&'static str>,
    pub seeds: RangeInclusive<u64>,
    pub on_board: bool,
    lines: Vec<&'static str>,
}

/// A drive with a motor.
pub trait Bench {
    fn plant(&mut self) -> &mut Plant;
    fn state(&self) -> State;
    /// Gives the drive a line as it is typed at the console; the drive must accept it.
    fn order(&mut self, line: &str);
    /// Runs a control period.
    fn period(&mut self) -> Seen;
}

/// Returns all rows.
pub fn rows() -> impl Iterator<Item = Row> {
    include_str!("../rows.txt").split("\nrow ").skip(1).map(|row| {
        let (head, lines) = row.split_once('\n').expect(row);
        let words = || head.split(' ');
        let seeds = |word: &'static str| word.strip_prefix("seeds=")?.split_once('-');
        let (first, last) = words().find_map(seeds).unwrap_or(("1", "1"));
        let is_change = |word: &&str| word.contains('=') && !word.starts_with("seeds=");
        let lines = lines.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        Row {
            name: words().next().unwrap_or_default(),
            changes: words().filter(is_change).collect(),
            seeds: number(first) as u64..=number(last) as u64,
            on_board: words().any(|word| word == "board"),
            lines: lines.collect(),
        }
    })
}

fn number(word: &str) -> f64 {
    word.parse().unwrap_or_else(|_| panic!("{word}: not a number"))
}

/// Whether a state has this name; `Fault` is any fault.
fn is(state: State, name: &str) -> bool {
    format!("{state:?}") == name || name == "Fault" && matches!(state, State::Fault(_))
}

impl Row {
    /// Plays the row.
    ///
    /// # Panics
    /// A bound does not hold.
    pub fn play(&self, bench: &mut impl Bench) {
        for line in &self.lines {
            match line.split(' ').collect::<Vec<_>>()[..] {
                ["shaft", "free", torque] => {
                    bench.plant().set_load(Load::Free { torque: number(torque) }).unwrap();
                }
                ["shaft", rpm] => {
                    let speed = number(rpm) * std::f64::consts::TAU / 60.0;
                    bench.plant().set_load(Load::Speed { speed }).unwrap();
                }
                ["dc", "link", volts] => bench.plant().set_dc_link(number(volts)).unwrap(),
                ["until", state, ref within @ ..] => {
                    let mut left = RATE_HZ * within.get(1).map_or(LONGEST_S, |s| number(s));
                    while !is(bench.state(), state) {
                        assert!(left > 0.0, "{}, `{line}`: {}", self.name, bench.state());
                        bench.period();
                        left -= 1.0;
                    }
                }
                [seconds, "s" | "s:", ..] => {
                    let bounds = line.split_once(": ").map_or("", |(_, bounds)| bounds);
                    for _ in 0..(number(seconds) * RATE_HZ).round() as u32 {
                        let (seen, state) = (bench.period(), bench.state());
                        let wrong = bounds.split_terminator(", ").find(|b| !holds(b, &seen, state));
                        assert_eq!(wrong, None, "{}, `{line}`: {seen:?}, {state}", self.name);
                    }
                }
                _ => bench.order(line),
            }
        }
    }
}

/// Whether a bound holds in a period.
fn holds(bound: &str, seen: &Seen, state: State) -> bool {
    let [quantity, low, "to", high] = bound.split(' ').collect::<Vec<_>>()[..] else {
        return is(state, bound);
    };
    let at = QUANTITIES.iter().position(|name| *name == quantity).expect(bound);
    (number(low)..=number(high)).contains(&seen[at])
}
