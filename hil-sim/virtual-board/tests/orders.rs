//! Cycles of the control interrupts that take requests from the console.

use crate::common;
use crate::common::pair::Pair;
use anyhow::{Context, Result};
use drive_core::State;
use hil_sim::Config;
use induction_drive::board::{LONGEST_INTERRUPT_CYCLES, PWM_TOP};

/// Longest time until a request is taken, periods: one that changes a setting runs the design rules first.
const LONGEST: usize = 30_000;
/// Number of periods until it is answered.
const ANSWERED: u64 = 300;
/// Cycles of a period.
const PERIOD: u32 = 2 * PWM_TOP as u32;

/// Returns the cycles of the interrupt that takes the request of a line, and of the median interrupt around it.
fn cost(pair: &mut Pair, line: &str) -> Result<(u32, u32)> {
    let (mut taken, mut all) = (None, Vec::new());
    pair.board.type_line(line);
    pair.shadow.type_line(line);
    while taken.is_none() && all.len() < LONGEST {
        pair.run(1, |_, period| {
            all.push(period.cycles);
            taken = taken.max(period.took_order.then_some(period.cycles));
        })?;
    }
    pair.run(ANSWERED, |_, period| {
        all.push(period.cycles);
        taken = taken.max(period.took_order.then_some(period.cycles));
    })?;
    all.sort_unstable();
    let (taken, median) = (taken.context(line.to_owned())?, all[all.len() / 2]);
    println!(
        "{line:<16} {taken:>6} cycles, others {median:>6}: {}",
        pair.board.take_console().trim_end()
    );
    Ok((taken, median))
}

/// While the drive regulates, a request of any kind leaves four fifths of the period; while it is off, when much is
/// computed again, half.
#[test]
fn an_order_leaves_most_of_the_period() -> Result<()> {
    let mut pair = common::pair(&Config::default(), 5)?;
    pair.ask("set motor.inertia 0.013")?;
    for line in ["apply", "start"] {
        let (taken, _) = cost(&mut pair, line)?;
        assert!(taken <= LONGEST_INTERRUPT_CYCLES, "{line}: {taken} cycles");
    }
    pair.until_state(State::Torque)?;
    for line in ["torque 1", "torque 9", "start", "relock"] {
        let (taken, _) = cost(&mut pair, line)?;
        assert!(taken < PERIOD / 5, "{line}: {taken} cycles");
    }
    pair.until_state(State::Torque)?;
    let (taken, _) = cost(&mut pair, "stop")?;
    assert!(taken < PERIOD / 5, "stop: {taken} cycles");
    Ok(())
}
