//! Faults of the wires at the terminal strip: with the drive off, and while it turns because of the strip, with a switch at START.

use anyhow::{Result, ensure};
use hil_sim::plant::Load;
use rand::{Rng, RngExt};
use serde::Deserialize;

use super::judge::{Outcome, wait};
use super::scene::Scene;
use stm32g4_unicorn::chip::TICKS_PER_S;
use virtual_board::board::{Board, TICKS_PER_PERIOD};

/// A fault.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    /// A wire breaks, and is repaired.
    Open,
    /// A contact is bridged.
    Shorted,
    /// A contact bounces.
    Chatters,
    /// The reference changes suddenly.
    Reference,
    /// The temperature sensor of the motor is open or shorted.
    Sensor,
}

/// Settings of a terminal strip that commands, with all its inputs.
const SET_UP: [&str; 4] = [
    "angle encoder",
    "set strip.enable yes strip.start switch strip.reverse yes strip.reset yes strip.presets yes strip.outputs yes motor.sensor pt1000",
    "set strip.reference 4-20ma strip.reference_rpm 600 speed.ramp_rpm_per_s 1000 bus.commands strip",
    "apply",
];
/// Reference signal at the beginning, mA: 300 rpm.
const HALF_MA: f64 = 12.0;
/// Index of the analog input of the motor's sensor, and the sensor at 25 degC: 1097 ohm at the divider's 4700 ohm.
const SENSOR: usize = 2;
const WARM: f64 = 1097.0 / (1097.0 + 4700.0);
/// Number of periods until the settings are in force, and until the speed has settled.
const SETTLING: u64 = 12_000;
const RISING: u64 = 15_000;
/// Longest time until the outputs are off, ms: with ENABLE open, two checks and the end of the torque; by ramp from 300
/// rpm at 1000 rpm/s.
const COASTED_MS: f64 = 150.0;
const RAMPED_MS: f64 = 600.0;
/// Duration of a fault, of the time after it, and the longest time between two bounces, ms.
const FAULT_MS: f64 = 650.0;
const BOUNCE_MS: f64 = 15.0;

const WIRES: [&str; 6] = ["ENABLE", "START", "REVERSE", "RESET", "PRESET1", "PRESET2"];

impl Scene {
    /// Goes to the drive off with ENABLE closed, or turning because of the strip.
    fn strip(&mut self, turns: bool) -> Result<()> {
        if self.strip.is_none() {
            self.off(0)?;
            let inertia = format!("set motor.inertia {}", self.target.inertia);
            let board = &mut self.board;
            board.plant.set_load(Load::Free { torque: 0.0 })?;
            board.set_reference([HALF_MA; 2]);
            board.set_analog(SENSOR, WARM);
            board.set_contact("ENABLE", true)?;
            for line in [inertia.as_str()].into_iter().chain(SET_UP) {
                board.type_line(line);
                wait(board, 300)?;
            }
            wait(board, SETTLING)?;
            let off = board.keep()?;
            board.set_contact("START", true)?;
            wait(board, RISING)?;
            ensure!(board.chip().tim1.outputs_on(), "no start: {}", board.take_console());
            self.strip = Some([off, board.keep()?]);
        }
        let Some(snapshots) = &self.strip else { return Ok(()) };
        self.board.go_back(&snapshots[usize::from(turns)])
    }
}

/// Watches the outputs for the duration of a fault; returns whether they came on, and when they went off, ms.
fn watch(
    board: &mut Board,
    mut each: impl FnMut(&mut Board, f64) -> Result<()>,
) -> Result<(bool, Option<f64>)> {
    let (began, mut starts, mut off) = (board.chip().now, false, None);
    let mut on = board.chip().tim1.outputs_on();
    for period in 0..(FAULT_MS * 6.0) as u64 {
        let ms = period as f64 / 6.0;
        each(board, ms)?;
        board.run_ticks(TICKS_PER_PERIOD)?;
        while board.next_period().is_some() {}
        let now = board.chip().tim1.outputs_on();
        starts |= now && !on;
        if on && !now {
            off = Some((board.chip().now - began) as f64 * 1e3 / TICKS_PER_S as f64);
        }
        on = now;
    }
    Ok((starts, off))
}

/// Runs a fault with the drive off or turning, and then restores the wires. Nothing may start, and the outputs must go
/// off if the fault requires it.
///
/// # Errors
/// The drive does not behave so.
pub fn run(scene: &mut Scene, fault: Fault, turn: u64, rng: &mut dyn Rng) -> Result<Outcome> {
    let turns = turn % 2 == 1;
    scene.strip(turns)?;
    let board = &mut scene.board;
    wait(board, rng.random_range(0..60))?;
    let wire = WIRES[rng.random_range(0..WIRES.len())];
    let ma = rng.random_range(0.0..24.0);
    let closed = wire == "ENABLE" || wire == "START" && turns;
    // A bridge across START with ENABLE closed is a start, so here it comes before ENABLE.
    let early = fault == Fault::Shorted && wire == "START" && !turns;
    if early {
        board.set_contact("ENABLE", false)?;
        wait(board, 60)?;
    }
    let (mut next, mut bounces) = (0.0, closed);
    let (started, off) = watch(board, |board, ms| {
        match fault {
            Fault::Reference => board.set_reference([ma; 2]),
            Fault::Sensor => board.set_analog(SENSOR, f64::from(u8::from(ma > HALF_MA))),
            Fault::Open => board.set_contact(wire, false)?,
            Fault::Shorted => board.set_contact(wire, true)?,
            Fault::Chatters if ms >= next => {
                (next, bounces) = (ms + rng.random_range(0.2..BOUNCE_MS), !bounces);
                board.set_contact(wire, bounces)?;
            }
            Fault::Chatters => {}
        }
        Ok(())
    })?;
    // If START was open for long, closing it again means that the switch is closed again, so it is not repaired.
    let mended = !(wire == "START" && fault == Fault::Open);
    let (again, _) = watch(board, |board, _| {
        board.set_reference([HALF_MA; 2]);
        board.set_analog(SENSOR, WARM);
        board.set_contact("ENABLE", true)?;
        board.set_contact(wire, (closed || early) && mended)
    })?;
    let lost = fault == Fault::Sensor || fault == Fault::Reference && !(3.6..=21.0).contains(&ma);
    let breaks = matches!(fault, Fault::Open | Fault::Chatters) && closed;
    let bound = match wire {
        _ if !turns || !(lost || breaks) => None,
        _ if fault == Fault::Sensor => Some(COASTED_MS),
        "ENABLE" if breaks => Some(COASTED_MS),
        _ => Some(RAMPED_MS),
    };
    let what = format!("{wire}, {ma:.1} mA, {}", if turns { "turning" } else { "off" });
    ensure!(!started && !again, "{what}: the outputs came on");
    // If the fault does not require a stop, the drive continues.
    ensure!(board.chip().tim1.outputs_on() == (turns && bound.is_none()), "{what}: the outputs");
    let late = bound.is_some_and(|bound| off.is_none_or(|ms| ms > bound));
    let fault_is_told = board.terminal_outputs()[1] == (lost && turns);
    ensure!(fault_is_told, "{what}: FAULT is {:?}", board.terminal_outputs());
    ensure!(!late || fault == Fault::Chatters, "{what}: off after {off:?} ms");
    Ok(Outcome { what, off_ms: off, ..Outcome::default() })
}
