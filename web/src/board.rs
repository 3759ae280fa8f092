//! A board without hardware: the firmware's interfaces, its drive and a simulated motor, connected by the bytes of a serial port.
//!
//! Lines that begin with `!` are for the motor and its surroundings; all others go to the console.

use std::collections::VecDeque;

use drive_core::{Line, State};
use drive_settings::SettingsError;
use induction_drive::console::handle::Port;
use induction_drive::front::Front;
use induction_drive::settings::FirmwareSettings;
use induction_drive::{board, modbus, terminals};
use motor_plant::{
    InverterSettings, Load, MeasurementSettings, MechanicsSettings, Plant, PlantSettings,
};

use crate::around;
use crate::machine::Machine;
use crate::motors::Motor;

/// Control periods from one pass of the main loop to the next. The next constant is the number of passes per millisecond.
const PERIODS: u32 = 3;
const PASSES: u32 = board::PWM_HZ / 1000 / PERIODS;
/// Longest self-commissioning. The next constant is the time in which the flux has decayed after it.
const LONGEST_LEARNING_MS: u32 = 200_000;
const REST_MS: u32 = 2000;
/// Temperature of the heat sink, degrees Celsius.
const HEAT_SINK_C: f32 = 25.0;

/// The board, see the head of the module.
pub struct HostBoard {
    front: Front,
    /// Drive and motor.
    pub machine: Machine,
    /// Motor and sensors as they were at power-up.
    pub healthy: PlantSettings,
    wires: Wires,
    contacts: Contacts,
    /// The line that is being received.
    line: Vec<u8>,
    now_ms: u32,
}

/// The serial port: bytes to the console and from it.
#[derive(Default)]
struct Wires {
    input: VecDeque<u8>,
    output: Vec<u8>,
}

/// The contacts that are closed. Nothing is connected to the other terminals.
#[derive(Clone, Copy, Default)]
struct Contacts(terminals::Contacts);

impl terminals::Port for Contacts {
    fn look(&mut self) -> terminals::Contacts {
        self.0
    }
}

impl Port for Wires {
    fn read(&mut self) -> Option<u8> {
        self.input.pop_front()
    }
    fn take_damage(&mut self) -> bool {
        false
    }
    fn write(&mut self, bytes: &[u8]) -> bool {
        self.output.extend(bytes);
        true
    }
    fn change_rate(&mut self, _: u32) -> bool {
        true
    }
}

/// A board without a field bus.
enum NoBus {}

impl modbus::Port for NoBus {}

/// The plant that `cargo sim` simulates with this motor, with the ADCs and the timer of the reference board, as on the virtual board.
pub fn plant_settings(motor: &Motor, settings: &FirmwareSettings) -> PlantSettings {
    let (scales, own) = (&settings.drive.scales, MeasurementSettings::DEFAULT);
    let dead_time_s = board::dead_time(settings.drive.inverter.dead_time_s).1;
    let mut plant = PlantSettings {
        mechanics: MechanicsSettings { load: Load::Locked, ..MechanicsSettings::DEFAULT },
        inverter: InverterSettings {
            timer_top: board::PWM_TOP,
            pulses: settings.drive.inverter.switching_khz.pulses(),
            dead_time_us: f64::from(dead_time_s) * 1e6,
            ..InverterSettings::DEFAULT
        },
        measurement: MeasurementSettings {
            lsb_a: own.lsb_a * f64::from(scales.current_a.gain / Line::CHANNEL_A.gain),
            heat_sink_code: scales.ntc.code(HEAT_SINK_C),
            ..own
        },
        ..PlantSettings::DEFAULT
    };
    motor.suit(&mut plant);
    plant
}

/// The settings of the reference board for a motor. The bench steps were done.
pub fn settings(motor: &Motor) -> FirmwareSettings {
    let mut settings = FirmwareSettings::of_the_board();
    motor.set(&mut settings.drive);
    settings.confirm_board();
    settings
}

impl HostBoard {
    /// A board that has just been powered up; the shaft is locked. Equal seeds give equal boards, to the bit.
    ///
    /// # Errors
    /// The reason why the plant or the drive refuses its settings.
    pub fn new(motor: &Motor, seed: u64) -> Result<Self, String> {
        let settings = settings(motor);
        let healthy = plant_settings(motor, &settings);
        let plant = Plant::new(&healthy, seed).map_err(|why| why.to_string())?;
        Self::on(plant, healthy, &settings).map_err(|why| why.to_string())
    }

    fn on(
        plant: Plant,
        healthy: PlantSettings,
        settings: &FirmwareSettings,
    ) -> Result<Self, SettingsError> {
        let (front, machine) = (Front::new(*settings), Machine::new(plant, settings)?);
        let (wires, contacts) = (Wires::default(), Contacts::default());
        let mut board =
            Self { front, machine, healthy, wires, contacts, line: Vec::new(), now_ms: 0 };
        board.front.console.greet(&board.machine);
        Ok(board)
    }

    /// Lets the drive learn its motor, as fast as possible, and save the result. The shaft must be locked.
    ///
    /// # Errors
    /// The error message of the board.
    pub fn learn(&mut self) -> Result<(), String> {
        self.write(b"learn\n");
        for _ in 0..LONGEST_LEARNING_MS {
            self.millisecond();
            if self.front.desk.learned().is_some() && self.machine.drive().state() == State::Off {
                self.write(b"save\n");
                (0..REST_MS).for_each(|_| self.millisecond());
                return Ok(());
            }
        }
        Err(String::from_utf8_lossy(&self.read()).into_owned())
    }

    /// Takes bytes of the port.
    pub fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.line.push(*byte);
            if *byte == b'\n' {
                let line = std::mem::take(&mut self.line);
                let text = String::from_utf8_lossy(&line);
                let (tag, rest) = match text.split_once(' ') {
                    Some((tag, rest)) if tag.starts_with('@') => (tag, rest),
                    _ => ("", &*text),
                };
                match rest.trim().strip_prefix('!') {
                    Some(words) => {
                        let done = match words.strip_prefix("strip") {
                            Some(names) => around::contacts(names).map(|c| self.contacts.0 = c),
                            None => around::change(&mut self.machine.plant, &self.healthy, words),
                        };
                        let answer =
                            done.map_or_else(|why| format!("error: {why}"), |()| "ok".into());
                        let answer = format!("{tag} {answer}\r\n");
                        self.wires.output.extend(answer.trim_start().bytes());
                    }
                    None => self.wires.input.extend(line),
                }
            }
        }
    }

    /// The bytes of the port since the last call.
    pub fn read(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.wires.output)
    }

    /// Simulates a millisecond.
    pub fn millisecond(&mut self) {
        for _ in 0..PASSES {
            (0..PERIODS).for_each(|_| self.machine.period());
            let (port, drive) = (&mut self.wires, &mut self.machine);
            self.front.pass(port, None::<&mut NoBus>, &mut self.contacts, drive, self.now_ms);
        }
        self.now_ms = self.now_ms.wrapping_add(1);
        if self.machine.resets {
            let (mut plant, saved) = (self.machine.plant.clone(), self.machine.saved);
            plant.set_pulses(saved.drive.inverter.switching_khz.pulses());
            // The saved settings were in force, so a board can be built with them.
            if let Ok(board) = Self::on(plant, self.healthy, &saved) {
                *self = Self { contacts: self.contacts, ..board };
            }
        }
    }
}
