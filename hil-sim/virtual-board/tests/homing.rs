//! Homing by the image, against a stop of the simulated shaft.

use crate::common;
use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use hil_sim::config::LoadMode;
use virtual_board::Board;

#[test]
fn the_image_finds_the_stop_and_counts_from_it() -> Result<()> {
    let mut config = Config::default();
    (config.load.mode, config.shaft.stops_turns) = (LoadMode::Free, 0.4);
    let mut pair = common::pair(&config, 43)?;
    for line in ["angle encoder", "start position"] {
        pair.order(line)?;
    }
    pair.until_state(State::Position)?;
    // From here the image gives itself commands, which its shadow on the host does not know.
    let mut board = pair.board;
    let say = |board: &mut Board, line: &str, until: &str| {
        board.take_console();
        board.type_line(line);
        common::until_within(board, until, 120_000)
    };
    let said = say(&mut board, "home 60 0.6 2", "homing: ")?;
    assert!(said.contains("homing: position 0 is at the stop"), "{said}");
    let stop = board.plant.mechanical_angle();
    say(&mut board, "position -0.25", "ok")?;
    // A stop by ramp waits until the shaft is at rest.
    board.run_periods(12_000)?;
    let said = say(&mut board, "stop ramp", "off: ")?;
    let end = board.plant.mechanical_angle();
    let moved = (end - stop) / std::f64::consts::TAU;
    println!("the stop at {stop:.3} rad, then {moved:.4} turns: {said}");
    assert!((moved + 0.25).abs() < 0.003, "{moved} turns");
    Ok(())
}
