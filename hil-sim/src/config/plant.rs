//! The plant that a configuration describes.

use std::f64::consts::TAU;

use drive_core::io::CONVERTER_CODES;
use drive_core::settings::Line;

use super::{Config, LoadMode};
use crate::plant::{
    InverterSettings, Load, MachineSettings, MeasurementSettings, MechanicsSettings, PlantSettings,
    SaliencySettings,
};

/// Scales of the drive's current channels a and b that match these sensors, without their errors.
pub fn current_lines(sensors: &MeasurementSettings) -> [Line; 2] {
    sensors
        .calibration()
        .map(|line| Line { gain: line.a_per_code as f32, offset: line.a_at_zero as f32 })
}

/// The plant that the configuration describes.
pub fn plant_settings(config: &Config) -> PlantSettings {
    let (m, i, s) = (&config.motor, &config.inverter, &config.measurement);
    // Unset values follow the dissertation's bench, in proportion.
    let reference = MeasurementSettings::default();
    let relative_voltage = i.dc_link_v / InverterSettings::default().vdc;
    let relative_range = s.range_a / reference.range_a;
    PlantSettings {
        machine: MachineSettings {
            rs: m.r_s,
            rr: m.r_r,
            lls: m.l_ls,
            llr: m.l_lr,
            lm: m.l_m,
            pole_pairs: m.pole_pairs,
        },
        saliency: SaliencySettings {
            a_psi: config.saliency.a_psi,
            b1: config.saliency.b1.unwrap_or(0.036 / config.amperes(1.0)),
            chi: config.saliency.chi,
            hold_a: config.saliency.hold_a.unwrap_or(config.amperes(5.0)),
            psi_n: Some(config.saliency.psi_n.unwrap_or(config.amperes(0.7) * m.l_m)),
        },
        inverter: InverterSettings {
            vdc: i.dc_link_v,
            dead_time_us: i.dead_time_s * 1e6,
            propagation_us: i.propagation_us,
            residual_v: i.residual_v.unwrap_or(1.64 * relative_voltage),
            switched: i.switched,
            ..InverterSettings::default()
        },
        measurement: MeasurementSettings {
            noise_a: s.noise_a.unwrap_or(reference.noise_a * relative_range),
            range_a: s.range_a,
            lsb_a: s.lsb_a.unwrap_or(reference.lsb_a * relative_range),
            filter_hz: s.filter_hz,
            gain_error_a: s.gain_error_a,
            gain_error_b: s.gain_error_b,
            offset_a: s.offset_a,
            offset_b: s.offset_b,
            dc_link_v: s
                .dc_link_range_v
                .map_or(reference.dc_link_v * relative_voltage.max(1.0), |range| {
                    range / f64::from(CONVERTER_CODES)
                }),
            heat_sink_code: config.drive.scales.ntc.code(s.heat_sink_c as f32),
        },
        mechanics: MechanicsSettings {
            inertia: m.inertia,
            friction: m.friction,
            load: match config.load.mode {
                LoadMode::Locked => Load::Locked,
                LoadMode::Free => Load::Free { torque: config.load.torque_nm.unwrap_or(0.0) },
                LoadMode::Speed => Load::Speed { speed: config.load.speed_rpm * TAU / 60.0 },
            },
        },
        ..PlantSettings::default()
    }
}
