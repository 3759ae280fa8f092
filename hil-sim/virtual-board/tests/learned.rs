//! The table that the drive learns on its motor survives a loss of power.

use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use virtual_board::periph::Reset;
use virtual_board::{Counting, Image, Options, Pair};

/// Longest duration of the saliency self-commissioning, periods: ten minutes.
const LEARNING: u64 = 3_600_000;
/// Longest time from a reset to the greeting, and of a list, periods.
const LISTED: u64 = 30_000;

/// Returns all lines of an answer that ends with `ok`.
fn list(pair: &mut Pair, line: &str) -> Result<Vec<String>> {
    let mut text = pair.say(line)? + "\r\n";
    pair.until("the end of the list", LISTED, |pair, _| {
        text += &pair.board.take_console();
        text.lines().last().is_some_and(|line| line.starts_with("ok")) && text.ends_with('\n')
    })?;
    Ok(text.lines().map(str::to_owned).collect())
}

/// Interrupts the power.
fn power_cycle(pair: &mut Pair) -> Result<()> {
    let settings = *pair.shadow.firmware_settings();
    pair.board.reset(Reset::Power);
    pair.shadow.restart(settings)?;
    pair.until("the greeting", LISTED, |pair, _| pair.board.take_console().ends_with('\n'))
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
    assert_eq!(pair.say("learned")?, "ok: nothing learned with these settings");
    // Points every 0.107 A, a fourteenth of the limit.
    pair.order("set speed.i_q_limit_a 1")?;
    pair.order("set limits.current_a 1.5")?;
    pair.order("learn")?;
    pair.until_state(State::Learning)?;
    pair.until("the end of learning", LEARNING, |_, state| state == State::Off)?;
    // The console learns of it with the report.
    pair.run(10, |_, _| {})?;

    let learned = list(&mut pair, "learned")?;
    println!("{learned:#?}");
    let (_, mismatch) = learned[0].split_once("gain mismatch ").expect("the gains");
    let mismatch: f64 = mismatch.split(' ').next().unwrap_or("").parse()?;
    assert!((mismatch - 0.01).abs() < 0.0025, "{mismatch}");
    // From 0 A to 1.29 A, with a summary, a header and an end.
    assert_eq!(learned.len(), 2 + 13 + 1);
    pair.order("save")?;

    power_cycle(&mut pair)?;
    assert!(pair.shadow.firmware_settings().learned.is_some());
    assert_eq!(list(&mut pair, "learned")?, learned);
    pair.start_torque()?;
    pair.order("torque 1")?;
    pair.run(3000, |_, _| {})?;
    Ok(())
}
