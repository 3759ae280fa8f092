//! The plant that a configuration describes.

use std::f64::consts::TAU;

use drive_core::Line;
use drive_core::io::CONVERTER_CODES;
use drive_settings::value::Words as _;

use super::{Config, FluxLevel, LoadMode};
use crate::plant::{FAMILIES, IronSettings, Load, MeasurementSettings, PlantSettings};

/// Scales of the drive's current channels a and b that match these sensors, without the sensors' errors.
pub fn current_lines(sensors: &MeasurementSettings) -> [Line; 2] {
    sensors
        .calibration()
        .map(|line| Line { gain: line.a_per_code as f32, offset: line.a_at_zero as f32 })
}

/// The magnetising current, A peak, at whose flux the numbers of a saturation model hold.
pub fn flux_level_a(config: &Config) -> f64 {
    match config.model.flux_level {
        FluxLevel::Low => config.amperes(0.7),
        FluxLevel::High => {
            let plate = &config.drive.nameplate;
            let rated_flux = f64::from(plate.voltage_v) * (2.0_f64 / 3.0).sqrt()
                / (TAU * f64::from(plate.frequency_hz));
            let of_current = 0.55 * std::f64::consts::SQRT_2 * f64::from(plate.current_a);
            of_current.min(rated_flux / config.motor.l_m)
        }
    }
}

/// Returns the plant that the configuration describes. Unset values follow the dissertation's bench, in proportion to
/// rated current, dc link and range of the sensors. Unset values of the saturation come from the saturation model,
/// which model A does not have: values per ampere scale with the rated current, and the skin effect with the rotor
/// leakage inductance.
pub fn plant_settings(config: &Config) -> PlantSettings {
    let (m, i, s) = (&config.motor, &config.inverter, &config.measurement);
    let mut plant = PlantSettings::DEFAULT;
    let per_ampere = 1.0 / config.amperes(1.0);
    let relative_voltage = i.dc_link_v / plant.inverter.vdc;
    let relative_range = s.range_a / plant.measurement.range_a;
    plant.saliency.b1 = 0.036 / config.amperes(1.0);
    plant.saliency.hold_a = config.amperes(5.0);
    plant.saliency.psi_n = Some(config.saliency.psi_n.unwrap_or(config.amperes(0.7) * m.l_m));
    plant.inverter.residual_v = 1.64 * relative_voltage;
    plant.inverter.dead_time_us = i.dead_time_s * 1e6;
    plant.inverter.pulses = config.drive.inverter.switching_khz.pulses();
    plant.inverter.extra_dead_time_us = i.extra_dead_time_s * 1e6;
    plant.measurement.noise_a *= relative_range;
    plant.measurement.lsb_a *= relative_range;
    plant.measurement.dc_link_v *= relative_voltage.max(1.0);
    if let Some(range_v) = s.dc_link_range_v {
        plant.measurement.dc_link_v = range_v / f64::from(CONVERTER_CODES);
    }
    plant.measurement.heat_sink_code = config.drive.scales.ntc.code(s.heat_sink_c as f32);
    plant.mechanics.stops = config.shaft.stops_turns * TAU;
    plant.mechanics.load = match config.load.mode {
        LoadMode::Locked => Load::Locked,
        LoadMode::Free => Load::Free { torque: config.load.torque_nm.unwrap_or(0.0) },
        LoadMode::Speed => Load::Speed { speed: config.load.speed_rpm * TAU / 60.0 },
    };
    let family = FAMILIES.iter().find(|family| family.name == config.model.plant.word());
    let mut iron = family.map_or(IronSettings::DEFAULT, |family| family.iron);
    iron.psi_n = flux_level_a(config) * m.l_m;
    iron.nominal_a = config.amperes(iron.nominal_a);
    iron.leakage_saturation *= per_ampere;
    iron.rotor_leakage_saturation *= per_ampere;
    iron.skin_leakage = iron.skin_leakage * m.l_lr / plant.machine.llr;
    config.copy_to(&mut plant, &mut iron);
    plant.iron = family.map(|_| iron);
    plant
}

/// Returns the interrupted phase, 0 to 2.
pub fn open_phase(config: &Config) -> Option<usize> {
    (config.inverter.open_phase as usize).checked_sub(1)
}
