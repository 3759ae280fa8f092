//! The rotor time constant is identified and used while the image runs.

use crate::common;
use crate::common::pair::Pair;
use anyhow::Result;
use drive_core::State;
use hil_sim::Config;
use hil_sim::rig::wrapped_degrees;

/// Returns the error of the drive's flux angle, degrees: mean over some periods.
fn angle_error(pair: &mut Pair, periods: u32) -> Result<f64> {
    let mut sum = 0.0;
    pair.run(periods.into(), |pair, _| {
        let phi = f64::from(pair.shadow.drive.telemetry().phi.to_turns()) * std::f64::consts::TAU;
        sum += wrapped_degrees(pair.board.plant.rotor_flux_angle() - phi);
    })?;
    Ok(sum / f64::from(periods))
}

/// Returns the rotor time constant that the image reports as used, ms, and whether there is an estimate.
fn status(pair: &mut Pair) -> Result<(f64, bool)> {
    let answer = pair.ask("status")?;
    let status = answer.last();
    let used = status.rsplit_once("; used ").and_then(|(_, used)| used.strip_suffix(" ms"));
    let used = used.and_then(|used| used.parse().ok());
    Ok((used.unwrap_or_else(|| panic!("{status}")), !status.contains("not found")))
}

/// The motor's rotor has 30 % more resistance than the drive assumes, as if it were 75 degrees warmer. With the encoder
/// and 2 A the time constant of the drive converges to the motor's, and so does the flux angle. The host stays
/// identical to the bit: it identifies the same values as the image, otherwise the requests and then the compare values
/// would differ. The console prints traces meanwhile: if the main loop were too slow, a period would be lost, which the
/// host's ring does not lose.
#[test]
fn a_rotor_that_is_warmer_than_believed_is_found() -> Result<()> {
    let mut config = Config::default();
    config.motor.r_r *= 1.3;
    let mut pair = common::pair(&config, 31)?;
    for line in ["angle encoder", "set track_rotor yes", "start torque"] {
        pair.order(line)?;
    }
    pair.until_state(State::Torque)?;
    pair.order("torque 2")?;
    pair.run(3000, |_, _| {})?;
    let (nominal, found) = status(&mut pair)?;
    assert!(!found, "before the memory of 1.7 s is full");
    let truth = 1e3 * pair.board.plant.tau_r();
    assert!((nominal / truth - 1.3).abs() < 0.01, "{nominal} ms for {truth} ms");
    let before = angle_error(&mut pair, 1200)?;

    // Three seconds until there is an estimate, 1.5 s for 30 % in steps of 2 %, and its settling.
    for _ in 0..6 {
        pair.board.type_line("trace 500 1");
        pair.run(6000, |_, _| {})?;
        let lines = pair.board.take_console().lines().count();
        assert!(lines > 100, "{lines} lines of a trace in a second");
    }
    // Any line cuts the trace short.
    pair.board.type_line("version");
    pair.run(600, |_, _| {})?;
    let after = angle_error(&mut pair, 1200)?;
    let (used, found) = status(&mut pair)?;
    // As on the host: within 6 % at nine points, 1.4 degrees (`cargo sim run online-tracking`).
    assert!(found && (used / truth - 1.0).abs() < 0.06, "{used} ms for {truth} ms");
    assert!(before.abs() > 5.0 && after.abs() < 1.4, "{before} and {after} degrees");

    // A cage with 30 % more resistance is 75 K above 25 degC; 6 % of the time constant are 15 K.
    let warm = pair.ask("status")?;
    let celsius = warm.last().split_once("; rotor ").and_then(|(_, rest)| rest.split(' ').next());
    let celsius: f64 = celsius.and_then(|number| number.parse().ok()).unwrap_or_default();
    assert!((celsius - 100.0).abs() < 20.0, "{warm:?}");

    // Without torque the rotor is not observable: the status reports this, and the time constant in use stays.
    pair.order("torque 0")?;
    pair.run(18_000, |_, _| {})?;
    let (kept, found) = status(&mut pair)?;
    assert!(!found && (kept / used - 1.0).abs() < 0.05, "{kept} ms after {used} ms");
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    Ok(())
}
