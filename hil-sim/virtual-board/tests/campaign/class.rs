//! The classes of faults that `classes.toml` lists, and the injection of each while the drive regulates.

use std::collections::BTreeMap;

use anyhow::{Result, bail};
use rand::{Rng, RngExt};
use serde::Deserialize;

use super::faults::{bad_code, flip_register, losing, name, noise, set_clocks, slow_sensor};
use super::scene::{Source, Target};
use super::strip;
use induction_drive::board as firmware_board;
use stm32g4_unicorn::{chip::TICKS_PER_S, cpu::Register, memory::Region, periph::iwdg::LSI_HZ};
use virtual_board::board::Board;
use virtual_board::faults::{Fault, current, flip};

/// The procedure of a run.
#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Run {
    /// A fault is injected while the drive regulates.
    #[default]
    Regulating,
    /// The power is interrupted in one of the operations of `save`.
    Saving,
    /// A double word of the saved settings is damaged before a start.
    DamagedPage,
    /// The reset pin is pulled, while the drive regulates or while it starts.
    Reset,
    /// Faults of wires at the terminal strip, with the drive off and while it turns.
    Strip(strip::Fault),
}

/// The contents of the file.
#[derive(Deserialize)]
struct Table {
    class: Vec<Class>,
    bound: BTreeMap<String, Bound>,
}

/// A bound: its time, ms, additional control periods, and the reason.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Bound {
    #[serde(default)]
    ms: f64,
    #[serde(default)]
    periods: f64,
    why: String,
    why_at_speed: Option<String>,
}

/// A class of faults.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Class {
    /// Its name.
    pub name: String,
    /// Longest time for which outputs may be on with wrong control, ms, and the reason. If it is infinite, nothing is
    /// guaranteed for the angle, and only the currents are judged.
    #[serde(skip)]
    pub bound: (f64, String),
    #[serde(rename = "bound")]
    name_of_bound: String,
    /// The angle sources with which it is tried.
    #[serde(default = "both")]
    pub sources: Vec<Source>,
    /// Whether it is excluded from a campaign at speed.
    #[serde(default)]
    at_rest_only: bool,
    /// The procedure of its runs.
    #[serde(default)]
    pub run: Run,
    /// Whether the outputs must be off after the bound even if the control is correct.
    #[serde(default)]
    pub ends: bool,
    /// Whether it begins with the drive off instead of regulating, and lines that are typed before.
    #[serde(default)]
    pub off: bool,
    #[serde(default)]
    pub lines: Vec<String>,
    /// Its faults, if they are not those of [`Class::inject`].
    #[serde(default)]
    pub faults: Vec<Fault>,
    /// Text that log or console must show.
    pub told: Option<String>,
    /// Number of resets that it may cause.
    #[serde(default = "one_reset")]
    pub resets: usize,
}

fn one_reset() -> usize {
    1
}

fn both() -> Vec<Source> {
    vec![Source::Sensorless, Source::Encoder]
}

/// A PWM period, ms.
pub const PERIOD_MS: f64 = 1.0 / 6.0;
const TIM1_CR1: u32 = 0x4001_2c00;
const OVERRUN_MS: f64 = 2.0;
/// Characters of a flood of text at the console.
const TEXT: &[u8; 20] = b"stausorquepi \n0123.-";

impl Class {
    /// Returns the classes of a campaign with their bounds, at speed or not.
    pub fn all(at_speed: bool) -> Vec<Self> {
        let table = toml::from_str(include_str!("classes.toml"));
        let Table { mut class, bound } = table.expect("the table of classes");
        class.retain(|class| !(at_speed && class.at_rest_only));
        for class in &mut class {
            let Bound { ms, periods, why, why_at_speed } = &bound[&class.name_of_bound];
            let why = why_at_speed.as_ref().filter(|_| at_speed).unwrap_or(why);
            class.bound = (ms + periods * PERIOD_MS, why.clone());
        }
        class
    }

    /// Injects a fault, and returns its description.
    ///
    /// # Errors
    /// The class has no injection.
    pub fn inject(&self, board: &mut Board, target: &Target, rng: &mut dyn Rng) -> Result<String> {
        let addresses = &target.addresses;
        let mut what = String::new();
        match self.name.as_str() {
            "nothing (for comparison)" => {}
            "current sensor stuck" => {
                let (which, now) = (target.any_current(rng), board.sample());
                let value = *current(which, &mut { now });
                board.disturb = Some(Box::new(move |s| *current(which, s) = value));
                what = format!("{} at {value}", name(which));
            }
            "current sensor saturated" => {
                let (which, high) = (target.any_current(rng), rng.random::<bool>());
                let code = if high { firmware_board::ADC_FULL_SCALE } else { 0 };
                board.disturb = Some(Box::new(move |s| *current(which, s) = code));
                what = format!("{} at {code}", name(which));
            }
            "current sensor noisy" => {
                let which = target.any_current(rng);
                // 5 mA to 2 A rms on the dissertation's motor.
                let amperes = target.relative_current * 0.005 * 400_f64.powf(rng.random::<f64>());
                let codes = amperes / f64::from(target.line(which).gain.abs());
                let mut noise = noise(rng, codes);
                board.disturb = Some(Box::new(move |s| noise(current(which, s))));
                what = format!("{}, {:.1} mA", name(which), 1e3 * amperes);
            }
            "dc-link sensor stuck, open, saturated, noisy" => {
                what = slow_sensor(board, rng, |s| &mut s.dc_link);
            }
            "heat-sink sensor stuck, open, saturated, noisy" => {
                what = slow_sensor(board, rng, |s| &mut s.heat_sink);
            }
            "not-a-number in the drive's state" => {
                let Region { address: base, size } = addresses.state;
                // The word must hold a plausible number; angles and counts belong to another class.
                for _ in 0..1000 {
                    let address = base + 4 * rng.random_range(0..size / 4);
                    let value = f32::from_bits(board.cpu.word(address).unwrap_or(0)).abs();
                    if (1e-5..1e5).contains(&value) {
                        board.cpu.write(address, &f32::NAN.to_le_bytes());
                        let word = (address - base) / 4;
                        return Ok(format!("word {word} of the control's state"));
                    }
                }
                what = "no such word".into();
            }
            "encoder loses counts of up to 6 rpm" => {
                what = losing(board, rng.random_range(0.0..6.0) / target.encoder_rpm);
            }
            "clock failure" => board.set_crystal(false),
            "flash ECC in code" => what = bad_code(board, rng),
            "bit flip in the coefficients" => what = flip(board, rng, addresses.coefficients),
            "bit flip in a register" => what = flip_register(board, rng),
            "bit flip in the drive's state" => what = flip(board, rng, addresses.state),
            "bit flip in the control's code" => what = flip(board, rng, target.code),
            "bit flip anywhere in the control's data" => what = flip(board, rng, addresses.control),
            "bit flip in RAM, stack included" => {
                let stack = Region { address: target.stack.end() - 1024, size: 1024 };
                let area = if rng.random() { target.data } else { stack };
                what = flip(board, rng, area);
            }
            "timer update dropped" => {
                let count = rng.random_range(1..6);
                board.chip().tim1.drop_update = count;
                what = format!("{count} of them");
            }
            "timer update duplicated" => board.chip().tim1.extra_update(),
            "conversion trigger lost" => {
                let which = rng.random_range(0..3_usize);
                // Permanently, or for a while that may be longer than the watchdog waits.
                let for_good = rng.random_range(0..4) == 0;
                let count = if for_good { u32::MAX } else { rng.random_range(1..40) };
                board.chip().adc.lose_triggers = [[count, 0], [0, count], [count, count]][which];
                what = format!("{} of them, {}", count, ["one", "two", "both"][which]);
            }
            "console garbage and floods" => {
                let mut bytes = vec![0; rng.random_range(1..3000)];
                let text = rng.random::<bool>();
                for byte in &mut bytes {
                    *byte = if text { TEXT[rng.random_range(0..TEXT.len())] } else { rng.random() };
                }
                board.send(&bytes);
                what = format!("{} bytes{}", bytes.len(), if text { " of text" } else { "" });
            }
            "interrupt overrun" => {
                let ms = rng.random_range(0.005..OVERRUN_MS);
                board.stall((ms * 1e-3 * TICKS_PER_S as f64) as u64);
                what = format!("{ms:.3} ms");
            }
            "LSI off its frequency" => {
                let hz = [0.0, rng.random_range(8e3..28e3), rng.random_range(36e3..60e3)];
                what = set_clocks(board, 0.0, hz[rng.random_range(0..3_usize)]);
            }
            "crystal off its frequency" => {
                let error = rng.random_range(0.04..0.3);
                what = set_clocks(board, if rng.random() { error } else { -error }, LSI_HZ);
            }
            "reference voltage off" => {
                let error = rng.random_range(0.035..0.1);
                let error = if rng.random() { error } else { -error };
                board.chip().set_reference(error);
                what = format!("{:.1} %", 100.0 * error);
            }
            "TIM1 stops" => {
                let cr1 = board.chip().read(TIM1_CR1, 4);
                board.chip().write(TIM1_CR1, 4, cr1 & !1);
            }
            "core hangs" => board.hang(),
            "stack overflow" => {
                let room = 8 * rng.random_range(0..13);
                board.cpu.set(Register::SP, target.stack.address + room);
                what = format!("room for {room} bytes");
            }
            other => bail!("{other}: a class without an injection"),
        }
        Ok(what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_of_the_break_is_its_reaction_in_the_firmware() {
        let classes = Class::all(false);
        let bound = classes.iter().find(|class| class.name == "break pin").unwrap().bound.0;
        assert_eq!((bound * 1e6).round(), f64::from(firmware_board::BREAK_REACTION_NS));
    }
}
