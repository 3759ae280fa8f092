//! Options of a board.

use drive_core::settings::{Line, SETTINGS};
use hil_sim::config::{Config, current_lines};
use hil_sim::plant::{MeasurementSettings, PlantSettings};

use crate::chip::TICKS_PER_S;
use crate::cpu::Counting;
use crate::periph::tim1::GateLimits;
use induction_drive::board as firmware_board;

/// Options of a board.
pub struct Options {
    /// The motor and everything around it; see [`Options::plant`].
    pub plant: PlantSettings,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Counting of cycles and instructions.
    pub counting: Counting,
    /// Limits of the gate signals.
    pub gates: GateLimits,
}

impl Options {
    /// The plant that a configuration describes, with the sensors and the dead time of this board.
    pub fn plant(config: &Config) -> PlantSettings {
        let mut plant = hil_sim::config::plant_settings(config);
        // The converters have another reference than the source's; their codes cover the range of the sensors.
        let gain = f64::from(firmware_board::CURRENT_A.gain / Line::CHANNEL_A.gain);
        let source = MeasurementSettings::default();
        let range = plant.measurement.range_a / source.range_a;
        plant.measurement.lsb_a = source.lsb_a * gain * range;
        plant.inverter.dead_time_us =
            f64::from(firmware_board::dead_time(firmware_board::DEAD_TIME_S).1) * 1e6;
        plant.inverter.timer_top = firmware_board::PWM_TOP;
        plant
    }

    /// The lines for the console that adapt the image to a configuration: its motor, and scales for its sensors at the
    /// converters of this board. Empty with the defaults.
    pub fn set_lines(config: &Config) -> Vec<String> {
        let [image, default] = [firmware_board::settings(), Config::default().drive];
        let mut wanted = config.drive;
        // Timer and converters are the board's.
        wanted.inverter.top = default.inverter.top;
        wanted.inverter.dead_time_s = default.inverter.dead_time_s;
        wanted.scales.full_scale = default.scales.full_scale;
        let differing = SETTINGS.iter().filter(|entry| entry.get(&wanted) != entry.get(&default));
        let differing: Vec<_> = differing.collect();
        let sensors = Self::plant(config).measurement;
        [wanted.scales.current_a, wanted.scales.current_b] = current_lines(&sensors);
        let needed = differing.iter().filter(|entry| entry.get(&wanted) != entry.get(&image));
        needed.map(|entry| format!("set {} {}", entry.name, entry.get(&wanted))).collect()
    }

    /// A board with the motor of a configuration.
    pub fn new(config: &Config, seed: u64) -> Self {
        let us = firmware_board::CYCLES_PER_US;
        let gates = GateLimits {
            // As the firmware asks for; the timer makes it a little longer.
            dead_time: (f64::from(firmware_board::DEAD_TIME_S) * TICKS_PER_S as f64).round() as u32,
            // A microsecond, less the rounding to counts.
            pulse: us - 2,
        };
        Self {
            plant: Self::plant(config),
            seed,
            counting: Counting { cycles: true, every_instruction: false },
            gates,
        }
    }
}
