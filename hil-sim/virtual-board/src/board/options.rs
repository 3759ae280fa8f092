//! Options of a board.

use anyhow::{Result, anyhow};
use drive_core::Line;
use drive_settings::{SETTINGS, Settings};
use drive_settings::{entry::Entry, value::Value};
use hil_sim::config::{Config, current_lines};
use hil_sim::plant::{MeasurementSettings, PlantSettings};

use crate::power_stage::{self, CODES, PowerStage, REFERENCE_V};
use induction_drive::board as firmware_board;
use stm32g4_unicorn::{Counting, circuit::Source};

/// Options of a board.
pub struct Options {
    /// The motor and everything around it; see [`Options::plant`].
    pub plant: PlantSettings,
    /// Seed of the sensors' noise.
    pub seed: u64,
    /// Counting of cycles and instructions.
    pub counting: Counting,
    /// Whether the bench steps were done and confirmed; otherwise the flash is erased, and the firmware does not start.
    pub confirmed: bool,
    /// The drive's settings that are saved with the confirmation. By default they are those with which the image
    /// starts, and the configuration decides whether a drive that has not learned starts.
    pub saved: Settings,
    /// The power stage at the pins.
    pub power_stage: &'static PowerStage,
    /// The circuit at the pin of the dc link, by default that of the power stage.
    pub dc_link_pin: Source,
    /// Resistor of the fault input, ohm, by default that of the power stage.
    pub fault_pull_ohm: f64,
}

impl Options {
    /// Returns the plant of a configuration, with the power stage, its sensors and the dead time of its board.
    pub fn plant(stage: &PowerStage, config: &Config) -> PlantSettings {
        let mut plant = hil_sim::config::plant_settings(config);
        let settings = stage.firmware_settings();
        if stage.shunts.is_none() {
            // The ADCs have another reference than the source's; their counts cover the range of the sensors.
            let gain = f64::from(settings.scales.current_a.gain / Line::CHANNEL_A.gain);
            let source = MeasurementSettings::default();
            let range = plant.measurement.range_a / source.range_a;
            plant.measurement.lsb_a = source.lsb_a * gain * range;
        }
        if let Some(divider) = stage.dc_link_divider {
            plant.measurement.dc_link_v = divider * REFERENCE_V / CODES;
        }
        plant.measurement.heat_sink_code = stage.ntc.code(config.measurement.heat_sink_c as f32);
        if let Some((delay_s, drop_v)) = stage.delay_and_drop {
            plant.inverter.propagation_us = delay_s * 1e6;
            plant.inverter.residual_v = drop_v;
        }
        // The ADCs of the board do this themselves.
        plant.measurement.both_zero_vectors = false;
        plant.inverter.dead_time_us =
            f64::from(firmware_board::dead_time(settings.inverter.dead_time_s).1) * 1e6;
        plant.inverter.timer_top = firmware_board::PWM_TOP;
        // The plant is advanced from one top of the counter to the next.
        plant.inverter.pulses = 1;
        plant
    }

    /// Returns the lines for the console that adapt the image of a board to a configuration: its motor, and on the
    /// reference board scales for its sensors at the ADCs of this board.
    pub fn set_lines(stage: &PowerStage, config: &Config) -> Vec<String> {
        let needed = Self::needed(stage, config);
        needed.into_iter().map(|(entry, value)| format!("set {} {value}", entry.name)).collect()
    }

    /// Returns these settings with their values.
    fn needed(stage: &PowerStage, config: &Config) -> Vec<(&'static Entry<Settings>, Value)> {
        let [image, default] = [stage.firmware_settings(), Config::default().drive];
        let mut wanted = config.drive;
        // Timer and ADCs belong to the board.
        wanted.inverter.top = image.inverter.top;
        wanted.inverter.dead_time_s = image.inverter.dead_time_s;
        wanted.scales.full_scale = image.scales.full_scale;
        // This setting is saved already.
        wanted.injection.synchronous.allow_unlearned = image.injection.synchronous.allow_unlearned;
        let in_line = stage.shunts.is_none();
        // The sensors of the reference board come from the configuration.
        let may_differ =
            SETTINGS.iter().filter(|entry| !in_line || entry.get(&wanted) != entry.get(&default));
        let differing: Vec<_> = may_differ.collect();
        if in_line {
            let sensors = Self::plant(stage, config).measurement;
            [wanted.scales.current_a, wanted.scales.current_b] = current_lines(&sensors);
        } else {
            wanted.scales = image.scales;
        }
        let needed = differing.iter().filter(|entry| entry.get(&wanted) != entry.get(&image));
        needed.map(|entry| (*entry, entry.get(&wanted))).collect()
    }

    /// Saves the settings for a configuration, as if [`Options::set_lines`] had been typed and saved before.
    ///
    /// # Errors
    /// A line that the image would refuse.
    pub fn set_up(mut self, config: &Config) -> Result<Self> {
        for (entry, value) in Self::needed(self.power_stage, config) {
            entry.set(&mut self.saved, value);
        }
        self.saved.check().map_err(|why| anyhow!("{why}"))?;
        Ok(self)
    }

    /// Options of the reference board with the motor of a configuration.
    pub fn new(config: &Config, seed: u64) -> Self {
        Self::on(&power_stage::REFERENCE, config, seed)
    }

    /// Options of a board with this power stage and the motor of a configuration; [`PowerStage::config`] gives a suitable one.
    pub fn on(power_stage: &'static PowerStage, config: &Config, seed: u64) -> Self {
        let plant = Self::plant(power_stage, config);
        let mut saved = power_stage.firmware_settings();
        saved.injection.synchronous.allow_unlearned =
            config.drive.injection.synchronous.allow_unlearned;
        Self {
            plant,
            seed,
            counting: Counting { cycles: true, every_instruction: false },
            confirmed: true,
            saved,
            power_stage,
            dc_link_pin: power_stage.dc_link_pin,
            fault_pull_ohm: power_stage.fault_pull_ohm,
        }
    }
}
