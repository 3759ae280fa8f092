//! Every board with the image that is built for it: the drivers are off unless the drive is on, and the drive works.

use std::f64::consts::TAU;

use crate::common::pair::Pair;
use anyhow::{Context, Result};
use drive_core::State;
use hil_sim::config::LoadMode;
use hil_sim::plant::Load;
use induction_drive::boards::{self, ANALOG, CONTACTS, Currents, Level, pin::Pin};
use stm32g4_unicorn::periph::Reset;
use virtual_board::board::Debugger;
use virtual_board::power_stage::{ALL, CODES, REFERENCE_V};
use virtual_board::{Board, Image, Options, PowerStage};

use crate::common::off_for;

/// An action that ends a run.
type End<'a> = &'a dyn Fn(&mut Board) -> Result<()>;

/// Number of periods between two reports of the control to the console.
const REPORT: u64 = 601;

/// Returns a board that is set up for its motor, with the encoder.
fn pair(stage: &'static PowerStage) -> Result<Pair> {
    let mut config = stage.config()?;
    config.load.mode = LoadMode::Locked;
    let options = Options::on(stage, &config, 1).set_up(&config)?;
    let mut pair = Pair::new(Image::built_for(stage.name)?, options)?;
    pair.order("angle encoder")?;
    Ok(pair)
}

fn start(pair: &mut Pair) -> Result<()> {
    pair.start_torque()?;
    assert!(pair.board.gates().any_on());
    Ok(())
}

/// The firmware's file of a board and the model of its hardware agree, each based on its own sources.
#[test]
fn the_firmware_and_the_power_stage_agree() {
    assert_eq!(ALL.map(|stage| stage.name), boards::NAMES);
    for stage in ALL {
        let board = stage.board();
        let (name, settings) = (stage.name, stage.firmware_settings());
        assert_eq!(board.name, name);
        let inputs = [
            (board.high.on_at.value, stage.driver.high),
            (board.low.on_at.value, stage.driver.low),
        ];
        for (on_at, input) in inputs {
            assert_eq!(on_at == Level::High, input.on_at_high, "{name}");
        }
        // Dead time of the timer; single precision has seven digits.
        let dead_time = f64::from(board.dead_time_s.value);
        assert!(dead_time > (1.0 - 1e-6) * stage.limits.dead_time_s, "{name}: {dead_time} s");
        // Pins.
        let Currents { a, b, shunts } = board.currents;
        let sensors = [a, b].into_iter().chain(shunts.map(|shunts| shunts.c));
        let wiring = stage.wiring;
        for (n, (sensor, channel)) in sensors.zip(wiring.currents).enumerate() {
            let at = if n == 1 { sensor.pin.adc2() } else { sensor.pin.adc1() };
            assert_eq!(at.map(usize::from), Some(channel), "{name}");
        }
        assert_eq!(board.dc_link.pin.adc1().map(usize::from), Some(wiring.dc_link), "{name}");
        assert_eq!(board.heat_sink.adc2().map(usize::from), Some(wiring.heat_sink), "{name}");
        let place = |pin: Pin| (pin.port as usize, u32::from(pin.number));
        for leg in 0..3 {
            let [high, low] = wiring.gates[leg].map(|gate| gate.0);
            assert_eq!((place(board.high.pins[leg]), place(board.low.pins[leg])), (high, low));
        }
        let (fault, relay) = (place(board.fault.pin), place(board.wiring.relay));
        assert_eq!((fault, relay), (wiring.fault.0, wiring.relay), "{name}");
        assert_eq!(board.wiring.crystal_hz, wiring.crystal_hz, "{name}");
        let analog = board.analog_only.iter().map(|pin| (pin.port as usize, u32::from(pin.number)));
        assert_eq!(analog.collect::<Vec<_>>(), stage.analog_only, "{name}");
        let (analog, others) = board.terminals.pins.split_at(ANALOG);
        let (contacts, outputs) = others.split_at(CONTACTS);
        for (ours, theirs) in stage.terminals.into_iter().zip([contacts, outputs, analog]) {
            let theirs =
                theirs.iter().map(|pin| pin.map_or("-".into(), |p| p.to_string()[1..].to_owned()));
            assert_eq!(ours, theirs.collect::<Vec<_>>().join(" "), "{name}");
        }
        assert_eq!(f64::from(board.fault.pull_ohm.value), stage.fault_pull_ohm, "{name}");
        assert_eq!(board.ntc.value, stage.ntc, "{name}");
        assert_eq!(
            f64::from(board.dc_link_limits.switches.value),
            stage.switches.rated_v,
            "{name}"
        );
        // Dc-link voltage, 1 %.
        if let Some(divider) = stage.dc_link_divider {
            let volts = 2000.0 / CODES * REFERENCE_V * divider;
            let seen = f64::from(settings.scales.dc_link.at(2000));
            assert!((seen / volts - 1.0).abs() < 0.01, "{name}: {seen} V of {volts} V");
        }
        // Currents: gains to 1 %, zero to 0.3 % of the range, both signs.
        match (stage.shunts, board.currents.shunts) {
            (None, None) => {}
            (Some(shunts), Some(boards::Shunts { settle_s, .. })) => {
                let scales = &settings.scales;
                for line in [scales.current_a, scales.current_b, scales.current_c] {
                    for code in [200, 1000, 3000, 4000] {
                        let volts = f64::from(code) / CODES * REFERENCE_V;
                        let amperes = (volts - shunts.zero_v) / shunts.volts_per_a;
                        let seen = f64::from(line.at(code));
                        let allowed = 0.01 * amperes.abs() + 0.003 * 1.6 / shunts.volts_per_a.abs();
                        assert!(
                            (seen - amperes).abs() < allowed,
                            "{name}: {seen} A of {amperes} A"
                        );
                    }
                }
                // Less than 1 % of a step remains.
                assert!(f64::from(settle_s.value) > 4.6 * shunts.settling_s, "{name}");
            }
            _ => panic!("{name}: sensors of different kinds"),
        }
    }
}

/// The check of the wiring, and steps of the torque with the encoder at 300 rpm: the motor's true torque equals the
/// command.
fn torque_steps(pair: &mut Pair, stage: &'static PowerStage) -> Result<()> {
    let config = stage.config()?;
    pair.board.take_log()?;
    start(pair)?;
    let log = pair.board.take_log()?;
    assert!(log.iter().any(|line| line.contains("checking the wiring")), "{log:#?}");
    pair.board.plant.set_load(Load::Speed { speed: config.rpm(300.0) * TAU / 60.0 })?;
    let settings = pair.shadow.settings();
    let per_ampere = f64::from(settings.motor.torque_per_ampere(settings.i_d()));
    for share in [1.0, 2.0, -1.5] {
        let i_q = config.amperes(share);
        pair.order(&format!("torque {i_q}"))?;
        pair.run(1800, |_, _| {})?;
        let (mut sum, mut count) = (0.0, 0.0);
        pair.run(1800, |pair, _| {
            sum += pair.board.plant.torque();
            count += 1.0;
        })?;
        let (torque, wanted) = (sum / count, per_ampere * i_q);
        assert!((torque / wanted - 1.0).abs() < 0.05, "{}", stage.name);
    }
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    off_for(&mut pair.board, REPORT)
}

/// One revolution with the encoder and a free shaft.
fn position_step(pair: &mut Pair, stage: &'static PowerStage) -> Result<()> {
    pair.board.plant.set_load(Load::Locked)?;
    pair.run(1, |_, _| {})?;
    pair.board.plant.set_load(Load::Free { torque: 0.0 })?;
    // Magnetising turns a free shaft a little; the position counts from the initial one.
    let from = pair.board.plant.mechanical_angle();
    pair.order("start position")?;
    pair.until_state(State::Position)?;
    pair.order("position 1")?;
    let mut largest: f64 = 0.0;
    let turns = |pair: &Pair| (pair.board.plant.mechanical_angle() - from) / TAU;
    pair.run(18_000, |pair, _| largest = largest.max(turns(pair)))?;
    let end = turns(pair);
    assert!((end - 1.0).abs() < 0.003 && largest < 1.01, "{}: {end}, {largest}", stage.name);
    pair.order("stop")?;
    pair.until_state(State::Off)?;
    off_for(&mut pair.board, REPORT)
}

/// Off by the fault input, by a probe that halts and continues the core, by the watchdog, by a failing supply, by the
/// reset pin and while another image is written: every gate is off then, and stays off.
fn every_end_leaves_every_gate_off(pair: &mut Pair, stage: &'static PowerStage) -> Result<()> {
    pair.board.plant.set_load(Load::Locked)?;
    start(pair)?;
    pair.run(600, |_, _| {})?;
    pair.board.run_ticks(7000)?;
    let running = pair.board.keep()?;
    let image = Image::built_for(stage.name)?;
    let ends: [(&str, End); 6] = [
        ("fault input", &|board| {
            board.set_fault_pin(false);
            board.run_ticks(100)
        }),
        ("halt", &|board| {
            board.attach(Debugger::ProbeRs);
            board.halt(1.0)?;
            assert!(!board.gates().any_on());
            board.halt(20.0)?;
            board.resume();
            // The watchdog runs on while the core is halted, or the first interrupt detects it.
            board.run_periods(3)
        }),
        ("watchdog", &|board| {
            board.hang();
            while board.resets.is_empty() {
                board.run_ticks(2000)?;
            }
            assert_eq!(board.resets[0].1, Reset::Window);
            Ok(())
        }),
        ("supply", &|board| {
            board.chip().set_supply(2.5);
            board.run_ticks(200)?;
            assert!(!board.gates().any_on());
            board.chip().set_supply(1.0);
            off_for(board, 60)?;
            board.chip().set_supply(3.3);
            Ok(())
        }),
        ("reset pin", &|board| {
            board.reset(Reset::Pin);
            Ok(())
        }),
        ("flashing", &|board| board.flash(&image, 50.0)),
    ];
    for (what, end) in ends {
        pair.board.go_back(&running)?;
        assert!(pair.board.gates().any_on(), "{what}");
        let ended = end(&mut pair.board).and_then(|()| off_for(&mut pair.board, 1200));
        ended.with_context(|| format!("{}: {what}", stage.name))?;
        assert!(pair.board.violations().is_empty(), "{what}: {:?}", pair.board.violations());
        pair.board.set_fault_pin(true);
    }
    Ok(())
}

fn works(stage: &'static PowerStage) -> Result<()> {
    let mut pair = pair(stage)?;
    torque_steps(&mut pair, stage)?;
    position_step(&mut pair, stage)?;
    every_end_leaves_every_gate_off(&mut pair, stage)
}

#[test]
fn the_reference_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[0])
}

#[test]
fn an_ihm08m1_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[1])
}

#[test]
fn an_ihm023v3_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[2])
}

#[test]
fn an_ipmm10b_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[3])
}

#[test]
fn an_ipm10b_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[4])
}

/// All pins that can be elsewhere are elsewhere.
#[test]
fn another_wiring_works_and_every_end_leaves_its_gates_off() -> Result<()> {
    works(ALL[5])
}
