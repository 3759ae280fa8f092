//! Cycles of the control interrupts that take requests from the console.

use crate::common;
use anyhow::{Context, Result};
use drive_core::State;
use hil_sim::Config;
use hil_sim::config::LoadMode;
use induction_drive::board::{LONGEST_INTERRUPT_CYCLES, PWM_TOP};
use virtual_board::{Board, Image, Options, Pair};

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

/// With V/f control there is no angle to find again: the request is refused and changes nothing. A quick stop brakes
/// the shaft faster than the ramp.
#[test]
fn with_voltage_and_frequency_an_angle_is_not_found_again_and_a_stop_brakes() -> Result<()> {
    let mut config = Config::default();
    config.load.mode = LoadMode::Free;
    let rpm = |board: &Board| board.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
    let run = |board: &mut Board, periods: u64| -> Result<String> {
        board.run_periods(periods)?;
        while board.next_period().is_some() {}
        Ok(board.take_console())
    };
    let mut board = Board::new(Image::built()?, Options::new(&config, 6))?;
    common::until_said(&mut board, "last run: ")?;
    for (line, periods) in [("start vf", 6000), ("speed 300", 12_000)] {
        board.type_line(line);
        let said = run(&mut board, periods)?;
        assert!(said.starts_with("ok"), "{line}: {said}");
    }
    let before = rpm(&board);
    assert!((270.0..330.0).contains(&before), "{before} rpm");
    board.type_line("relock");
    let said = run(&mut board, 600)?;
    assert!(said.starts_with("error: ") && (rpm(&board) - before).abs() < 5.0, "{said}");
    let turning = board.keep()?;
    let mut seconds = [0.0; 2];
    for (stop, seconds) in ["stop ramp", "stop quick"].into_iter().zip(&mut seconds) {
        board.go_back(&turning)?;
        board.type_line(stop);
        let mut periods = 0;
        while board.chip().tim1.outputs_on() {
            run(&mut board, 10)?;
            periods += 10;
            assert!(periods < 12_000, "{stop}: {} rpm", rpm(&board));
        }
        *seconds = f64::from(periods) / 6000.0;
        println!("{said}{stop}: {seconds:.2} s, {:.1} rpm", rpm(&board));
        assert!(rpm(&board).abs() < 40.0, "{stop}: {} rpm", rpm(&board));
    }
    let [ramp, quick] = seconds;
    assert!(quick < 0.5 * ramp && ramp < 1.5, "{seconds:?}");
    Ok(())
}
