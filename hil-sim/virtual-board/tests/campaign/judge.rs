//! The criterion of a run: at every instant after the bound, the outputs are off or the control is correct.

use std::f64::consts::TAU;

use anyhow::{Result, bail, ensure};

use stm32g4_unicorn::{chip::TICKS_PER_S, periph::Reset};
use virtual_board::board::{Board, TICKS_PER_PERIOD};
use virtual_board::faults::Script;

use super::class::PERIOD_MS;

/// Largest angle error of a correct control, electrical degrees.
const ANGLE_DEG: f64 = 15.0;
/// Number of periods from a reset until the log has reported it.
const REPORTED: u64 = 400;
/// Number of periods from the switch-off of the outputs until the log has reported it.
const FAULT_REPORTED: u64 = 60;
/// Largest number of periods from a reset to the greeting.
const START: u64 = 30_000;

/// The outcome of a run.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Description of the fault.
    pub what: String,
    /// Time from the fault to the switch-off of the outputs, ms.
    pub off_ms: Option<f64>,
    /// Time from the fault to the last instant with outputs on and wrong control, ms.
    pub wrong_ms: f64,
    /// Largest phase current, A.
    pub peak_a: f64,
    /// Largest angle error with the outputs on, degrees.
    pub angle_deg: f64,
}

/// Watches for `ms` after the end of the script, or until the outputs are off. It judges the currents, up to `trip_a`,
/// and, if `angle_counts`, the angle as well. With `ends_ms`, no gate may be on later than that after the last fault.
///
/// # Errors
/// Wrong gate signals, or another failure of the model.
pub fn watch(
    board: &mut Board,
    script: &mut Script,
    trip_a: f64,
    ms: f64,
    angle_counts: bool,
    ends_ms: Option<f64>,
) -> Result<Outcome> {
    let now = board.chip().now;
    let (began, until) = (script.began.max(now), script.ends.max(now));
    let mut outcome = Outcome::default();
    board.went_off = None;
    let since = |from: u64, at: u64| at.saturating_sub(from) as f64 * 1e3 / TICKS_PER_S as f64;
    let (mut next, mut right) = (now, now);
    while since(until, next) < ms {
        // The true angle of the motor and the drive's angle belong to the same sample.
        next += TICKS_PER_PERIOD;
        script.run_until(board, next)?;
        while board.next_period().is_some() {}
        let current =
            board.plant.phase_currents().into_iter().fold(0.0, |m: f64, i| m.max(i.abs()));
        outcome.peak_a = outcome.peak_a.max(current);
        if let Some(at) = board.went_off.take() {
            outcome.off_ms = Some(since(began, at));
            if ends_ms.is_none() {
                break;
            }
        }
        if let Some(bound) = ends_ms.filter(|bound| since(began, next) > bound + PERIOD_MS) {
            ensure!(!board.gates().any_on(), "a gate is on later than {bound} ms");
        }
        let error = if board.chip().tim1.outputs_on() { angle_error(board) } else { 0.0 };
        outcome.angle_deg = outcome.angle_deg.max(error);
        // A value that is not a number counts as wrong.
        let straight = error <= ANGLE_DEG || !angle_counts;
        if straight && current < trip_a {
            right = next;
        } else {
            // A fault that comes and goes: from when on the control was wrong without a break.
            outcome.wrong_ms =
                outcome.wrong_ms.max(since(if script.repeats { right } else { began }, next));
        }
    }
    Ok(outcome)
}

/// Runs for some periods that are not judged.
///
/// # Errors
/// An error of the emulator.
pub fn wait(board: &mut Board, periods: u64) -> Result<()> {
    board.run_periods(periods)?;
    while board.next_period().is_some() {}
    Ok(())
}

/// Angle between the true flux and the drive's estimate, degrees.
fn angle_error(board: &Board) -> f64 {
    let believed = f64::from(board.telemetry().phi.to_turns());
    let error = (board.plant.rotor_flux_angle() / TAU - believed).rem_euclid(1.0);
    error.min(1.0 - error) * 360.0
}

/// Checks, after the outputs have gone off, that the reason is in the log, and that there are no more resets than these.
///
/// # Errors
/// No reason in the log, or a loop of resets.
pub fn reported(board: &mut Board, whole_start: bool, resets: usize) -> Result<()> {
    board.run_periods(FAULT_REPORTED)?;
    if board.resets.is_empty() {
        let log = board.take_log()?;
        let told = log.iter().any(|line| line.contains("fault ") || line.contains("WARN"));
        if told || !board.resets.is_empty() {
            return Ok(());
        }
        // Only the watchdog may end it.
    }
    board.run_periods(REPORTED)?;
    let Some((_, reset)) = board.resets.first().copied() else {
        bail!("outputs off without a reason in the log: {:?}", board.take_log()?)
    };
    let log = board.take_log()?;
    let cause = reset.to_string();
    ensure!(log.iter().any(|line| line.contains(&cause)), "no {cause:?} in the log {log:?}");
    if reset == Reset::Software {
        ensure!(log.iter().any(|l| l.contains("the last run ended with")), "no reason: {log:?}");
    }
    if whole_start {
        greeting(board)?;
    }
    ensure!(board.resets.len() <= resets, "reset again and again: {:?}", board.resets);
    Ok(())
}

/// Runs until the firmware has greeted, and for 200 more periods.
///
/// # Errors
/// No greeting comes, or another reset occurs.
pub fn greeting(board: &mut Board) -> Result<String> {
    let resets = board.resets.len();
    let mut heard = String::new();
    for _ in 0..START / 100 {
        wait(board, 100)?;
        heard += &board.take_console();
        ensure!(board.resets.len() == resets, "reset while it starts: {:?}", board.resets);
        if heard.contains("last run: ") && heard.ends_with('\n') {
            board.run_periods(200)?;
            ensure!(board.resets.len() == resets, "reset after its start: {:?}", board.resets);
            return Ok(heard);
        }
    }
    bail!("no greeting, but {heard:?}")
}
