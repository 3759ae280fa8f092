//! The ELF and the same drive on the host compute the same bits.

use crate::common;
use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use virtual_board::Pair;

/// A start, magnetising, torque steps, a reversal and a stop, sensorless: every compare value of every
/// control interrupt is compared where it is written (see `Shadow::follow`).
#[test]
fn sixty_thousand_interrupts_of_a_sensorless_run_are_the_same() -> Result<()> {
    let mut pair = common::regulating(11)?;
    for i_q in ["1", "1.25", "1.5", "1.75", "2", "-1", "-2", "0.5"] {
        pair.order(&format!("torque {i_q}"))?;
        pair.run(6600, |_, _| {})?;
    }
    compare_telemetry(&pair);
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    pair.run(600, |_, _| {})?;
    assert!(pair.shadow.compared >= 60_000, "{}", pair.shadow.compared);
    Ok(())
}

/// The same with the encoder, after settings were changed at the console: the coefficients are designed
/// on both sides, with the same functions.
#[test]
fn a_drive_that_was_configured_at_the_console_is_the_same() -> Result<()> {
    let mut config = Config::default();
    config.load.mode = hil_sim::config::LoadMode::Free;
    let mut pair = common::pair(&config, 12)?;
    pair.order("angle encoder")?;
    pair.order("set motor.r_r 5.1")?;
    pair.order("start position")?;
    pair.until_state(State::Position)?;
    for turns in ["1", "-0.5"] {
        pair.order(&format!("position {turns}"))?;
        pair.run(6000, |_, _| {})?;
    }
    compare_telemetry(&pair);
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    assert!(pair.shadow.compared > 12_000);
    Ok(())
}

/// The address that the image publishes leads to the telemetry of the host's drive.
fn compare_telemetry(pair: &Pair) {
    let read = pair.board.telemetry();
    assert_ne!(read.rotor_freq, 0.0);
    assert_eq!(read, *pair.shadow.drive.telemetry());
}
