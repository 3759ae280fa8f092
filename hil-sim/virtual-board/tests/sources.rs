//! Core clock and reference voltage are compared with the other clock and the other reference of the chip: at start and
//! while the drive regulates.

use crate::common;
use anyhow::Result;
use drive_core::{Fault, State};
use hil_sim::Config;
use virtual_board::chip::TICKS_PER_S;
use virtual_board::periph::Reset;
use virtual_board::periph::iwdg::LSI_HZ;
use virtual_board::rules::Rule;
use virtual_board::{Board, Image, Options};

/// Changes clocks or reference.
type Change = fn(&mut Board);

/// Longest time from the change to the switch-off of the outputs, s.
const LATEST: f64 = 1.2;

/// Permitted values of the oscillators and the reference of a healthy chip, at the ends of the data sheet's ranges.
const SOUND: [(&str, Change); 4] = [
    ("slowest oscillator", |board| board.chip().set_clocks(0.001, 29.5e3)),
    ("fastest oscillator", |board| board.chip().set_clocks(-0.001, 34.0e3)),
    ("reference 2.5 % too low", |board| board.chip().set_reference(-0.025)),
    ("reference 2.5 % too high", |board| board.chip().set_reference(0.025)),
];

/// Values that are not permitted, and the fault.
const OFF: [(&str, Fault, Change); 7] = [
    ("oscillator at rest", Fault::WrongClock, |board| board.chip().set_clocks(0.0, 0.0)),
    ("oscillator too slow", Fault::WrongClock, |board| board.chip().set_clocks(0.0, 28.0e3)),
    ("oscillator too fast", Fault::WrongClock, |board| board.chip().set_clocks(0.0, 36.0e3)),
    ("crystal too fast", Fault::WrongClock, |board| board.chip().set_clocks(0.05, 30.0e3)),
    ("crystal too slow", Fault::WrongClock, |board| board.chip().set_clocks(-0.06, 33.5e3)),
    ("reference too low", Fault::WrongReference, |board| board.chip().set_reference(-0.04)),
    ("reference too high", Fault::WrongReference, |board| board.chip().set_reference(0.04)),
];

/// With a wrong clock or reference the greeting names it, `start` is refused because of it, and no gate goes on; after
/// a reset with a right one the drive starts. On the internal oscillator, whose own error is larger, the same
/// oscillators pass.
#[test]
fn a_wrong_clock_or_reference_is_not_started() -> Result<()> {
    let board = || Board::new(Image::built()?, Options::new(&Config::default(), 31));
    for (name, fault, change) in OFF {
        let mut board = board()?;
        change(&mut board);
        let heard = common::until_said(&mut board, "last run: ")?;
        assert!(heard.contains(&format!("not started: {fault}")), "{name}: {heard}");
        board.type_line("start torque");
        for _ in 0..1200 {
            board.run_periods(1)?;
            assert!(!board.gates().any_on(), "{name}");
        }
        let heard = board.take_console();
        assert!(heard.contains(&format!("error: the control does not run: {fault}")), "{heard}");
        if ["oscillator at rest", "reference too low"].contains(&name) {
            board.chip().set_clocks(0.0, LSI_HZ);
            board.chip().set_reference(0.0);
            board.reset(Reset::Pin);
            let heard = common::until_said(&mut board, "last run: ")?;
            assert!(!heard.contains("not started"), "{name}: {heard}");
        }
    }
    for (name, change) in SOUND {
        let mut board = board()?;
        change(&mut board);
        let heard = common::until_said(&mut board, "last run: ")?;
        assert!(!heard.contains("not started"), "{name}: {heard}");
    }
    for (error, hz) in [(0.015, 29.5e3), (-0.02, 34.0e3)] {
        let mut board = board()?;
        board.set_crystal(false);
        board.chip().set_clocks(error, hz);
        let heard = common::until_said(&mut board, "last run: ")?;
        assert!(!heard.contains("not started"), "{error} {hz}: {heard}");
    }
    Ok(())
}

/// While the drive regulates, permitted values change nothing. Wrong values switch the outputs off in time, with the
/// fault, and they stay off if the fault is cleared while the cause lasts. No rule of the chip is broken: the
/// conversions of the control are not disturbed.
#[test]
fn a_clock_or_reference_that_goes_wrong_switches_off() -> Result<()> {
    // With the encoder, because without it a step of the clock loses the lock first.
    let mut pair = common::pair(&Config::default(), 32)?;
    for line in ["angle encoder", "start torque"] {
        pair.order(line)?;
    }
    pair.until_state(State::Torque)?;
    let mut board = pair.board;
    board.collect_violations();
    let running = board.keep()?;
    for (name, change) in SOUND {
        board.go_back(&running)?;
        change(&mut board);
        board.run_periods(9000)?;
        assert!(board.chip().tim1.outputs_on(), "{name}: {:?}", board.take_log()?);
        assert!(board.resets.is_empty() && board.violations().is_empty(), "{name}");
    }
    for (name, fault, change) in OFF {
        board.go_back(&running)?;
        change(&mut board);
        let began = board.chip().now;
        while board.chip().tim1.outputs_on() {
            board.run_periods(1)?;
            let since = (board.chip().now - began) as f64 / TICKS_PER_S as f64;
            assert!(since < LATEST, "{name}: outputs on after {since} s");
        }
        let off_s = (board.chip().now - began) as f64 / TICKS_PER_S as f64;
        board.run_periods(3000)?;
        let log = board.take_log()?;
        let told = format!("fault {}: {fault}", fault.code());
        println!("{name}: off after {off_s:.3} s");
        assert!(log.iter().any(|line| line.contains(&told)), "{name}: {log:#?}");
        for line in ["clear", "start torque"] {
            board.type_line(line);
            board.run_periods(3000)?;
        }
        assert!(!board.chip().tim1.outputs_on(), "{name}: on again");
        let heard = board.take_console();
        assert!(heard.matches(&told).count() >= 2, "{name}: {heard}");
        // A watchdog without its clock accepts no writes, for which the firmware waits in vain when it writes the history.
        let mut broken = board.violations().iter().filter(|broken| broken.rule != Rule::IwdgBusy);
        assert!(board.resets.is_empty() && broken.next().is_none(), "{name}");
    }
    Ok(())
}
