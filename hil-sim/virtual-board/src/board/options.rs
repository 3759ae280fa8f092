//! Options of a board.

use drive_core::settings::{Line, SETTINGS};
use hil_sim::config::{Config, current_lines};
use hil_sim::plant::{MeasurementSettings, PlantSettings};

use crate::cpu::Counting;
use crate::power_stage::{self, CODES, PowerStage, REFERENCE_V};
use induction_drive::board as firmware_board;
use induction_drive::boards;

/// Options of a board.
pub struct Options {
    /// The motor and everything around it; see [`Options::plant`].
    pub plant: PlantSettings,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Counting of cycles and instructions.
    pub counting: Counting,
    /// Whether its bench steps were done and confirmed; otherwise the flash is erased, and the firmware does not start.
    pub confirmed: bool,
    /// The power stage at the pins.
    pub power_stage: &'static PowerStage,
}

impl Options {
    /// The plant that a configuration describes, with the sensors and the dead time of this board.
    pub fn plant(config: &Config) -> PlantSettings {
        let mut plant = hil_sim::config::plant_settings(config);
        // The converters have another reference than the source's; their codes cover the range of the sensors.
        let reference = firmware_board::settings_of(boards::ALL[0]);
        let gain = f64::from(reference.scales.current_a.gain / Line::CHANNEL_A.gain);
        let source = MeasurementSettings::default();
        let range = plant.measurement.range_a / source.range_a;
        plant.measurement.lsb_a = source.lsb_a * gain * range;
        plant.inverter.dead_time_us =
            f64::from(firmware_board::dead_time(reference.inverter.dead_time_s).1) * 1e6;
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

    /// The reference board with the motor of a configuration.
    pub fn new(config: &Config, seed: u64) -> Self {
        Self::on(&power_stage::REFERENCE, config, seed)
    }

    /// A board with this power stage and the motor of a configuration; [`PowerStage::config`] gives one that suits it.
    pub fn on(power_stage: &'static PowerStage, config: &Config, seed: u64) -> Self {
        let mut plant = Self::plant(config);
        if let Some(divider) = power_stage.dc_link_divider {
            plant.measurement.dc_link_v = divider * REFERENCE_V / CODES;
        }
        if let Some((delay_s, drop_v)) = power_stage.delay_and_drop {
            plant.inverter.propagation_us = delay_s * 1e6;
            plant.inverter.residual_v = drop_v;
        }
        Self {
            plant,
            seed,
            counting: Counting { cycles: true, every_instruction: false },
            confirmed: true,
            power_stage,
        }
    }
}
