//! The table that the drive learns on its motor survives a loss of power.

use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use virtual_board::periph::Reset;
use virtual_board::{Counting, Image, Options, Pair};

/// Longest duration of the saliency self-commissioning, periods: ten minutes.
const LEARNING: u64 = 3_600_000;

/// Interrupts the power.
fn power_cycle(pair: &mut Pair) -> Result<()> {
    pair.board.reset(Reset::Power);
    pair.shadow.restart()?;
    pair.greeted()
}

/// The drive learns sensors whose gains differ by 1 %, saves them, and corrects them after a power cycle: the board and
/// the host with the same settings then compute the same.
#[test]
fn what_is_learned_is_there_after_the_power_was_off() -> Result<()> {
    let mut config = Config::default();
    config.measurement.gain_error_a = 0.01;
    let mut options = Options::new(&config, 8);
    options.counting = Counting::default();
    let mut pair = Pair::new(Image::built()?, options)?;
    assert_eq!(pair.ask("learned")?.last(), "ok: nothing learned with these settings");
    // Points every 0.107 A, a fourteenth of the limit.
    pair.order("set speed.i_q_limit_a 1")?;
    pair.order("set limits.current_a 1.5")?;
    pair.order("learn")?;
    pair.until_state(State::Learning)?;
    pair.until("the end of learning", LEARNING, |_, state| state == State::Off)?;
    // The console learns of it with the report.
    pair.run(10, |_, _| {})?;

    let learned = pair.ask("learned")?.lines;
    println!("{learned:#?}");
    let (_, mismatch) = learned[0].split_once("gain mismatch ").expect("the gains");
    let mismatch: f64 = mismatch.split(' ').next().unwrap_or("").parse()?;
    assert!((mismatch - 0.01).abs() < 0.0025, "{mismatch}");
    // From 0 A to 1.29 A, with a summary, a header and an end.
    assert_eq!(learned.len(), 2 + 13 + 1);
    pair.order("save")?;

    power_cycle(&mut pair)?;
    assert!(pair.shadow.firmware_settings().learned.is_some());
    assert_eq!(pair.ask("learned")?.lines, learned);
    pair.start_torque()?;
    pair.order("torque 1")?;
    pair.run(3000, |_, _| {})?;
    Ok(())
}
