//! The image against settings and events that may damage its power stage: typed protections and scales, the boot pin, braking.

use crate::common::pair::Pair;
use anyhow::{Context, Result};
use drive_core::{Fault, State};
use hil_sim::Config;
use hil_sim::config::LoadMode;
use induction_drive::board::{CLOCK_HZ, HSI_HZ};
use stm32g4_unicorn::chip::TICKS_PER_S;
use stm32g4_unicorn::periph::{Reset, rcc};
use virtual_board::board::TICKS_PER_PERIOD;
use virtual_board::board::rom::{N_BOOT0, N_SWBOOT0};
use virtual_board::power_stage::{ALL, PowerStage, REFERENCE};
use virtual_board::{Board, Image, Options};

use crate::common::{say as ask, until_said as said};

fn board(stage: &'static PowerStage) -> Result<Board> {
    let mut board =
        Board::new(Image::built_for(stage.name)?, Options::on(stage, &stage.config()?, 5))?;
    said(&mut board, "last run: ")?;
    Ok(board)
}

/// Returns the gates that are requested on, or may be, of a chip that stands still.
fn gates_on(board: &mut Board) -> Vec<String> {
    let chip = board.chip();
    let stage = chip.circuit.stage;
    let mut on = Vec::new();
    for (leg, name) in ["a", "b", "c"].into_iter().enumerate() {
        let pins = stage.wiring.gates[leg];
        let requests = stage.driver.requests(pins, leg, &chip.gpio, &chip.tim1, true);
        for (side, request) in ["high", "low"].into_iter().zip(requests) {
            match request {
                None => on.push(format!("{side} {name} perhaps")),
                Some(wave) if wave.at(0) => on.push(format!("{side} {name}")),
                Some(_) => {}
            }
        }
    }
    on
}

/// With PB8 high at a reset and the option bytes from the factory, ST's boot loader runs and holds gate pins. With
/// nSWBOOT0 = 0 and nBOOT0 = 1 the pin has no effect, and the image starts with every gate off.
#[test]
fn the_boot_loader_drives_gates_unless_the_option_bytes_leave_it_out() -> Result<()> {
    let expected: [&[&str]; 3] = [
        &["high b"],
        &["high a perhaps", "low a", "high b", "high c perhaps"],
        &["high a perhaps", "low a", "high b", "high c perhaps"],
    ];
    for (stage, expected) in ALL.into_iter().zip(expected) {
        let mut board = board(stage)?;
        let started = board.keep()?;
        assert_eq!(gates_on(&mut board), [""; 0], "{}", stage.name);
        assert!(!board.reset_with_boot_pin(false), "a low pin");
        assert!(board.reset_with_boot_pin(true));
        assert_eq!(gates_on(&mut board), expected, "{}", stage.name);
        let why = board.run_periods(1).expect_err("nothing was noticed").to_string();
        assert!(why.contains("bad gate signals"), "{why}");
        // The image never starts.
        board.go_back(&started)?;
        board.chip().flash.options &= !(N_SWBOOT0 | N_BOOT0);
        assert!(board.reset_with_boot_pin(false));
        board.go_back(&started)?;
        board.chip().flash.options &= !N_SWBOOT0;
        board.chip().flash.options |= N_BOOT0;
        for high in [true, false] {
            assert!(!board.reset_with_boot_pin(high));
            said(&mut board, "last run: ")?;
            assert_eq!(gates_on(&mut board), [""; 0], "{}", stage.name);
        }
    }
    Ok(())
}

/// The window watchdog is fed too early if the control interrupt comes three times too often. (Up to about 2.3 times it
/// may come, because after a long interrupt the next one begins that early.) If the main loop checks that register just
/// then, it is faster.
#[test]
fn a_counter_at_a_third_of_its_top_is_reset() -> Result<()> {
    const TIM1_ARR: u32 = 0x4001_2c2c;
    const TIM1_CCR4: u32 = 0x4001_2c40;
    let mut board = board(&REFERENCE)?;
    board.forgive();
    ask(&mut board, "start torque", "ok")?;
    board.run_periods(1200)?;
    let energised = board.keep()?;
    let mut by_window = 0;
    for later in [0, 7_000, 39_000, 150_000] {
        board.go_back(&energised)?;
        board.run_ticks(later)?;
        assert!(board.gates().any_on() && board.resets.is_empty());
        let began = board.chip().now;
        // Also the compare value that triggers the ADCs, which the counter would not reach.
        for register in [TIM1_ARR, TIM1_CCR4] {
            let value = board.chip().read(register, 4);
            board.chip().write(register, 4, value / 3);
        }
        while board.resets.is_empty() && board.chip().now < began + 4 * TICKS_PER_PERIOD {
            board.run_ticks(100)?;
        }
        let (at, cause) = *board.resets.first().context("no reset")?;
        let periods = (at - began) as f64 / TICKS_PER_PERIOD as f64;
        let expected = matches!(cause, Reset::Window | Reset::Software);
        assert!(expected && periods < 2.0, "{cause} after {periods} periods");
        assert!(!board.chip().tim1.outputs_on());
        by_window += u32::from(cause == Reset::Window);
    }
    assert!(by_window > 0);
    Ok(())
}

/// A double word of the flash that its check code cannot correct is read as an instruction of the main loop, or as data
/// by the check of the control's code. The outputs go off at once, by the break and without software; the image
/// restarts.
#[test]
fn a_bad_word_in_the_code_switches_off() -> Result<()> {
    let mut board = board(&REFERENCE)?;
    ask(&mut board, "start torque", "ok")?;
    board.run_periods(1200)?;
    let regulating = board.keep()?;
    // The main loop runs from the first bank, the control interrupt from CCM.
    while !(0x0800_0000..0x0804_0000).contains(&board.chip().at) {
        board.run_ticks(1)?;
    }
    // After vectors and checksums of the copy.
    for (what, bad) in [("code", board.chip().at & !7), ("data", 0x0804_1000)] {
        board.go_back(&regulating)?;
        assert!(board.gates().any_on());
        board.chip().flash.bad_code = Some(bad);
        let began = board.chip().now;
        while board.chip().tim1.outputs_on() {
            board.run_ticks(20)?;
            assert!(board.chip().now < began + 130 * TICKS_PER_PERIOD, "{what}: still on");
        }
        board.run_periods(400)?;
        assert_eq!(board.resets.len(), 1, "{what}");
        let log = board.take_log()?;
        let told = |line: &String| line.contains("clock or flash failure");
        assert!(log.iter().any(told), "{what}: {log:#?}");
    }
    Ok(())
}

/// Stops a shaft from 1400 rpm on the board with 60 V transistors, whose supply takes no energy back; returns the
/// voltage of the link and at the switches, V, and the final state of the drive.
fn braking(capacitor_f: f64, rpm_per_s: f64) -> Result<(f64, f64, State)> {
    let stage = PowerStage::named("nucleo-g474re-ihm08m1")?;
    let mut config: Config = stage.config()?;
    config.load.mode = LoadMode::Free;
    config.motor.inertia *= 4.0;
    let link = &mut config.dc_link;
    (link.capacitor_f, link.source, link.load_w, link.pulses) = (capacitor_f, 0.1, 0.5, 0);
    let options = Options::on(stage, &config, 1).set_up(&config)?;
    let mut pair = Pair::new(Image::built_for(stage.name)?, options)?;
    let set = "set motor.inertia 0.004 speed.limit_rpm 1500 speed.ramp_rpm_per_s";
    for line in ["angle encoder", &format!("{set} {rpm_per_s}"), "start speed"] {
        pair.order(line)?;
    }
    pair.until_state(State::Speed)?;
    pair.order("speed 1400")?;
    pair.run(15_000, |_, _| {})?;
    let rpm = |pair: &Pair| pair.board.plant.mechanical_speed() * 30.0 / std::f64::consts::PI;
    assert!(rpm(&pair) > 1350.0, "{} rpm", rpm(&pair));
    pair.order("speed 0")?;
    let (mut link_v, mut stress_v) = (0.0_f64, 0.0_f64);
    for _ in 0..4500 {
        pair.run(1, |_, _| {})?;
        let plant = &pair.board.plant;
        link_v = link_v.max(plant.dc_link());
        stress_v = stress_v.max(stage.switches.stress_v(plant.dc_link(), plant.phase_currents()));
    }
    assert!(rpm(&pair) < 1300.0, "{} rpm", rpm(&pair));
    Ok((link_v, stress_v, pair.shadow.drive.state()))
}

/// The link voltage with the ringing of every turn-off stays below the rating of the transistors, whether the capacitor
/// is large enough for the braking, or so small that the drive trips.
#[test]
fn braking_stays_below_what_the_transistors_stand() -> Result<()> {
    let rated_v = PowerStage::named("nucleo-g474re-ihm08m1")?.switches.rated_v;
    let (link_v, stress_v, state) = braking(1e-3, 3000.0)?;
    assert!(link_v > 46.0 && link_v < 0.9 * rated_v, "{link_v} V");
    assert!(stress_v < 0.95 * rated_v, "{stress_v} V");
    assert_eq!(state, State::Fault(Fault::DcLinkOverVoltage));
    let (link_v, stress_v, state) = braking(4.7e-3, 1000.0)?;
    assert!(link_v > 44.0 && link_v < 49.0, "{link_v} V");
    assert!(stress_v < 0.95 * rated_v, "{stress_v} V");
    assert_eq!(state, State::Speed);
    Ok(())
}

/// The numbers of the emulated chip that the firmware states as well.
#[test]
fn clocks_of_the_chip_are_those_of_the_firmware() {
    assert_eq!(TICKS_PER_S, u64::from(CLOCK_HZ));
    assert_eq!(rcc::HSI_HZ, HSI_HZ);
}
