//! Brake chopper and precharge relay at their pins.

use crate::common;
use crate::common::pair::Pair;
use anyhow::{Context, Result};
use drive_core::State;
use hil_sim::Config;
use hil_sim::config::LoadMode;
use hil_sim::plant::{DcLinkSettings, Load};
use stm32g4_unicorn::periph::Reset;
use virtual_board::Board;
use virtual_board::board::Debugger;

/// The brake resistor, ohm.
const OHM: f64 = 100.0;
/// Voltage above which the drive trips, V.
const TRIP_V: f64 = 400.0;

/// Returns a drive with encoder and brake resistor, and this dc link.
fn braked(change: impl Fn(&mut Config), more: &[&str]) -> Result<Pair> {
    let mut config = Config::default();
    config.dc_link.chopper = OHM;
    change(&mut config);
    let mut pair = common::pair(&config, 41)?;
    pair.order("angle encoder")?;
    pair.order(&format!("set braking.ohm {OHM}"))?;
    for line in more {
        pair.order(line)?;
    }
    Ok(pair)
}

/// A capacitor behind a rectifier, which cannot feed energy back, and twice the inertia: 296 J at 1500 rpm. With 1.93
/// Nm the shaft stops in 2 s. Above 570 rpm it gives more than the 115 W that the copper takes, 114 J in all, of which
/// 11 J fit into the capacitor up to 378 V.
#[test]
fn braking_from_speed_into_the_resistor_stays_below_the_trip() -> Result<()> {
    let link = |config: &mut Config| {
        config.motor.inertia *= 2.0;
        config.load.mode = LoadMode::Free;
        let link = &mut config.dc_link;
        (link.capacitor_f, link.source, link.load_w, link.pulses) = (470e-6, 2.0, 5.0, 0);
    };
    let lines = [
        "set motor.inertia 0.024 sequence.i_d 1.4 speed.limit_rpm 1500 speed.ramp_rpm_per_s 1500",
        "start speed",
    ];
    let mut pair = braked(link, &lines)?;
    pair.until_state(State::Speed)?;
    pair.order("speed 1500")?;
    pair.run(18_000, |_, _| {})?;
    let rpm = |pair: &Pair| pair.board.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
    assert!(rpm(&pair) > 1400.0, "{} rpm", rpm(&pair));
    pair.order("speed 0")?;
    let (mut highest, mut most, mut burnt) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut n = 0;
    while rpm(&pair) > 50.0 {
        pair.run(1, |_, _| {})?;
        let (v, duty) = (pair.board.plant.dc_link(), pair.board.chopper_duty());
        // The timer's pulse equals the request of the drive's core, to half a tick.
        let asked = f64::from(pair.shadow.output.chopper);
        assert!((duty - asked).abs() < 1e-3, "{duty} at the pin, {asked} requested");
        (highest, most) = (highest.max(v), most.max(duty));
        burnt += duty * v * v / OHM / 6000.0;
        n += 1;
        assert!(n < 60_000, "still {} rpm", rpm(&pair));
    }
    assert_eq!(pair.shadow.drive.state(), State::Speed);
    assert!(highest < TRIP_V - 5.0, "{highest} V");
    // The estimate does not include magnetic energy and slip.
    assert!(most > 0.05 && (60.0..140.0).contains(&burnt), "{most}, {burnt} J");
    Ok(())
}

/// A motor of 100 W at a rectifier whose capacitor is much too small. With six pulses the ripple stays below the limit of
/// the warning; when a mains phase is lost, two pulses are left, and the log and the history tell it.
#[test]
fn a_lost_mains_phase_is_told() -> Result<()> {
    let mut pair = braked(|_| {}, &[])?;
    pair.board.plant.set_load(Load::Speed { speed: 300.0 * std::f64::consts::TAU / 60.0 })?;
    pair.start_torque()?;
    pair.order("torque 2")?;
    for pulses in [6, 2] {
        let link = DcLinkSettings { capacitor: 30e-6, pulses, ..DcLinkSettings::DEFAULT };
        pair.board.plant.set_supply(&link)?;
        pair.board.take_log()?;
        pair.run(6000, |_, _| {})?;
        assert_eq!(pair.shadow.drive.state(), State::Torque);
        let told = pair.board.take_log()?.iter().any(|l| l.contains("ripple of the dc link"));
        assert_eq!(told, pulses == 2, "{pulses} pulses");
    }
    let history = pair.ask("history")?;
    assert!(format!("{history:?}").contains("mains phase missing: 1 times"), "{history:?}");
    Ok(())
}

/// An action that ends a run.
type End<'a> = &'a dyn Fn(&mut Board) -> Result<()>;

/// A stiff link at 385 V, at which the chopper conducts for most of the time while the drive regulates.
#[test]
fn every_end_takes_the_chopper_off() -> Result<()> {
    let mut pair = braked(|_| {}, &["start torque"])?;
    pair.until_state(State::Torque)?;
    assert_eq!(pair.board.chopper_duty(), 0.0);
    pair.board.plant.set_dc_link(385.0)?;
    pair.run(600, |_, _| {})?;
    let duty = pair.board.chopper_duty();
    assert!((0.5..0.8).contains(&duty), "{duty}: 385 V of 378.3 to 388 V");
    let running = pair.board.keep()?;
    let ends: [(&str, u64, End); 6] = [
        ("stop", 1200, &|board| {
            board.type_line("stop");
            Ok(())
        }),
        ("fault", 2, &|board| {
            board.set_fault_pin(false);
            Ok(())
        }),
        ("halt", 0, &|board| {
            board.attach(Debugger::ProbeRs);
            board.halt(1.0)
        }),
        ("watchdog", 31, &|board| {
            board.hang();
            Ok(())
        }),
        ("supply", 0, &|board| {
            board.chip().set_supply(2.5);
            board.run_ticks(200)
        }),
        ("reset pin", 0, &|board| {
            board.reset(Reset::Pin);
            Ok(())
        }),
    ];
    for (what, periods, end) in ends {
        pair.board.go_back(&running)?;
        assert_eq!(pair.board.chopper_duty(), duty, "{what}");
        end(&mut pair.board).context(what)?;
        for _ in 0..periods {
            pair.board.run_periods(1).context(what)?;
            while pair.board.next_period().is_some() {}
        }
        assert_eq!(pair.board.chopper_duty(), 0.0, "{what}");
        pair.board.set_fault_pin(true);
        pair.board.chip().set_supply(3.3);
    }
    // A handler that ends the run: the main loop finds a flipped bit in the control's code.
    pair.board.go_back(&running)?;
    let address = pair.board.image.symbol("__eccm")?.address - 4;
    let word = pair.board.cpu.word(address).unwrap_or(0) ^ 1 << 20;
    pair.board.cpu.write(address, &word.to_le_bytes());
    pair.board.run_periods(130)?;
    assert_eq!(pair.board.resets.last().map(|r| r.1), Some(Reset::Software));
    assert_eq!(pair.board.chopper_duty(), 0.0);
    Ok(())
}

/// The link begins at 50 V and is charged through 200 ohm with a time constant of 94 ms. A start is refused in words
/// until the voltage is steady, and the relay opens when the mains are off.
#[test]
fn the_relay_closes_on_a_steady_link_and_a_start_waits_for_it() -> Result<()> {
    let link = |config: &mut Config| {
        let link = &mut config.dc_link;
        (link.capacitor_f, link.source, link.load_w, link.pulses) = (470e-6, 2.0, 5.0, 0);
        link.precharge = 200.0;
    };
    let mut pair = braked(link, &["set supply.relay_s 0.3", "apply"])?;
    let mains = 311.0;
    // The mains are switched off, and the other loads discharge the capacitor.
    pair.board.plant.set_mains(0.0)?;
    pair.until("an empty link", 60_000, |pair, _| pair.board.plant.dc_link() < 50.0)?;
    assert!(!pair.board.is_precharged());
    let answer = pair.ask("start torque")?;
    assert_eq!(
        answer.last(),
        "error: the precharge relay is open: the dc link is too low, or not steady yet"
    );
    pair.board.plant.set_mains(mains)?;
    let mut n = 0;
    while !pair.board.is_precharged() {
        pair.run(1, |_, _| {})?;
        n += 1;
        assert!(n < 12_000, "open at {} V", pair.board.plant.dc_link());
    }
    let (v, took) = (pair.board.plant.dc_link(), f64::from(n) / 6000.0);
    // With 200 ohm the load of 5 W costs 3.3 V; 5 V of band and 0.3 s leave 5 / (e^3.2 - 1) V more.
    assert!(v > mains - 5.0 && took > 0.3, "{v} V after {took} s");
    pair.start_torque()?;
    assert!(pair.board.is_precharged());
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    assert!(pair.board.is_precharged(), "a stop leaves the link charged");
    // A handler that ends the run opens the relay.
    let running = pair.board.keep()?;
    pair.board.hang();
    pair.board.run_periods(40)?;
    assert!(!pair.board.is_precharged(), "after the watchdog");
    pair.board.go_back(&running)?;
    pair.board.plant.set_mains(0.0)?;
    pair.until("under-voltage", 60_000, |pair, _| pair.board.plant.dc_link() < 199.0)?;
    pair.run(2, |_, _| {})?;
    assert!(!pair.board.is_precharged(), "below under-voltage");
    Ok(())
}
