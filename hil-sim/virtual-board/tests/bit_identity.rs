//! The ELF and the same drive on the host compute the same bits.

use crate::common;
use crate::common::pair::Pair;
use anyhow::Result;
use drive_core::State;
use drive_settings::Carrier;
use hil_sim::Config;
use virtual_board::{Image, Options};

/// A start, magnetising, torque steps, a reversal and a stop, sensorless: every compare value of every control
/// interrupt is compared where it is written (see `Shadow::follow`).
#[test]
fn sixty_thousand_interrupts_of_a_sensorless_run_are_the_same() -> Result<()> {
    let mut pair = common::regulating(11)?;
    for i_q in ["1", "1.25", "1.5", "1.75", "2", "-1", "-2", "0.5"] {
        pair.order(&format!("torque {i_q}"))?;
        pair.run(6600, |_, _| {})?;
    }
    compare_telemetry(&mut pair)?;
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    pair.run(600, |_, _| {})?;
    assert!(pair.shadow.compared >= 60_000, "{}", pair.shadow.compared);
    Ok(())
}

/// The same with the encoder, after settings were changed at the console: both sides design the coefficients with the
/// same functions.
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
    compare_telemetry(&mut pair)?;
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    assert!(pair.shadow.compared > 12_000);
    Ok(())
}

/// Two and three pulses in a control period: the interrupt still comes once per period, the torque is the commanded one
/// within 5 %, and the compare values are those of the host. This also holds with the currents of both zero vectors.
#[test]
fn a_drive_with_a_quiet_carrier_is_the_same() -> Result<()> {
    for (switching_khz, seed) in [(Carrier::Khz12, 13), (Carrier::Khz18, 14)] {
        let mut config = Config::default();
        config.drive.inverter.switching_khz = switching_khz;
        let mut pair = Pair::new(Image::built()?, Options::new(&config, seed).set_up(&config)?)?;
        assert_eq!(pair.shadow.settings().inverter.switching_khz, switching_khz);
        for both in ["no", "yes"] {
            pair.order(&format!("set scales.both_zero_vectors {both}"))?;
            pair.order("apply")?;
            with_pulses(&mut pair, switching_khz)?;
        }
        assert!(pair.shadow.compared > 48_000, "{}", pair.shadow.compared);
    }
    Ok(())
}

fn with_pulses(pair: &mut Pair, switching_khz: Carrier) -> Result<()> {
    pair.start_torque()?;
    let pulse = u64::from(pair.board.chip().tim1.period());
    let period = pulse * u64::from(switching_khz.pulses());
    assert_eq!(period, 28_332, "{switching_khz:?}");
    let settings = pair.shadow.settings();
    let per_ampere = f64::from(settings.motor.torque_per_ampere(settings.i_d()));
    for i_q in [1.5, -1.0] {
        pair.order(&format!("torque {i_q}"))?;
        pair.run(3000, |_, _| {})?;
        let (mut sum, mut before) = (0.0, None);
        pair.run(3000, |pair, control| {
            sum += pair.board.plant.torque() / 3000.0;
            let since = control.began - before.replace(control.began).unwrap_or(control.began);
            assert!(since == 0 || since.abs_diff(period) < 200, "{since} ticks");
        })?;
        let wanted = per_ampere * i_q;
        assert!((sum / wanted - 1.0).abs() < 0.05, "{switching_khz:?}: {sum} of {wanted} Nm");
    }
    compare_telemetry(pair)?;
    pair.order("stop")?;
    pair.until_state(State::Off)
}

/// The published address of the image leads to the telemetry of the host's drive. A run may end within a control interrupt, so the next
/// one is awaited.
fn compare_telemetry(pair: &mut Pair) -> Result<()> {
    let compared = pair.shadow.compared;
    while pair.shadow.compared == compared {
        pair.board.run_ticks(1000)?;
        while let Some(period) = pair.board.next_period() {
            pair.shadow.follow(&period)?;
        }
    }
    let read = pair.board.telemetry();
    assert_ne!(read.rotor_freq, 0.0);
    assert_eq!(read, *pair.shadow.drive.telemetry());
    Ok(())
}
