//! The criterion of a run: at every instant after the bound, the outputs are off or the control is correct.

use std::f64::consts::TAU;

use anyhow::{Result, bail, ensure};

use stm32g4_unicorn::{chip::TICKS_PER_S, periph::Reset};
use virtual_board::board::{Board, TICKS_PER_PERIOD};

/// Largest angle error of a correct control, electrical degrees.
const ANGLE_DEG: f64 = 15.0;
/// Number of resets that counts as a loop: the fault itself may cause the first reset.
const MOST_RESETS: usize = 2;
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

/// Watches for `ms` after the fault, or until the outputs are off. It judges the currents, up to `trip_a`, and, if
/// `angle_counts`, the angle as well.
///
/// # Errors
/// Wrong gate signals, or another failure of the model.
pub fn watch(board: &mut Board, trip_a: f64, ms: f64, angle_counts: bool) -> Result<Outcome> {
    let began = board.chip().now;
    let mut outcome = Outcome::default();
    board.went_off = None;
    let since = |at: u64| at.saturating_sub(began) as f64 * 1e3 / TICKS_PER_S as f64;
    let mut next = began;
    while since(next) < ms {
        // The true angle of the motor and the drive's angle belong to the same sample.
        next += TICKS_PER_PERIOD;
        let now = board.chip().now;
        board.run_ticks(next.saturating_sub(now))?;
        while board.next_period().is_some() {}
        let current =
            board.plant.phase_currents().into_iter().fold(0.0, |m: f64, i| m.max(i.abs()));
        outcome.peak_a = outcome.peak_a.max(current);
        if let Some(at) = board.went_off {
            outcome.off_ms = Some(since(at));
            break;
        }
        let error = angle_error(board);
        outcome.angle_deg = outcome.angle_deg.max(error);
        // A value that is not a number counts as wrong.
        let straight = error <= ANGLE_DEG || !angle_counts;
        if !(straight && current < trip_a) {
            outcome.wrong_ms = since(next);
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

/// Checks, after the outputs have gone off, that the reason is in the log, and that there is no loop of resets.
///
/// # Errors
/// No reason in the log, or a loop of resets.
pub fn reported(board: &mut Board, whole_start: bool) -> Result<()> {
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
    ensure!(board.resets.len() < MOST_RESETS, "reset again and again: {:?}", board.resets);
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
