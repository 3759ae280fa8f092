//! The plant that a configuration describes.

use std::f64::consts::TAU;

use drive_core::Line;
use drive_core::io::CONVERTER_CODES;

use super::{Config, FluxLevel, LoadMode};
use crate::config::value::Field as _;
use crate::plant::{
    DcLinkSettings, FAMILIES, InverterSettings, IronSettings, Load, MachineSettings,
    MeasurementSettings, MechanicsSettings, PlantSettings, SaliencySettings, WarmingSettings,
};

/// Scales of the drive's current channels a and b that match these sensors, without their errors.
pub fn current_lines(sensors: &MeasurementSettings) -> [Line; 2] {
    sensors
        .calibration()
        .map(|line| Line { gain: line.a_per_code as f32, offset: line.a_at_zero as f32 })
}

/// The direct current, A peak, at whose flux the numbers of a family of iron hold.
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

/// The iron that the configuration describes; none for model A. What a family has per ampere is in proportion to the
/// rated current, and its skin effect to the rotor leakage.
fn iron(config: &Config) -> Option<IronSettings> {
    let word = config.model.plant.to_value().to_string();
    let family = FAMILIES.iter().find(|family| family.name == word)?.iron;
    let (set, per_ampere) = (&config.iron, 1.0 / config.amperes(1.0));
    let skin = family.skin_leakage * config.motor.l_lr / MachineSettings::default().llr;
    Some(IronSettings {
        psi_n: set.psi_n.unwrap_or(flux_level_a(config) * config.motor.l_m),
        saturation: set.saturation.unwrap_or(family.saturation),
        exponent: set.exponent.unwrap_or(family.exponent),
        chord: set.chord,
        teeth: set.teeth.unwrap_or(family.teeth),
        teeth_gap: set.teeth_gap.unwrap_or(family.teeth_gap),
        teeth_turn_deg: set.teeth_turn_deg,
        teeth_turn_deg_per_a: set.teeth_turn_deg_per_a,
        leakage_saturation: set
            .leakage_saturation
            .unwrap_or(family.leakage_saturation * per_ampere),
        rotor_leakage_saturation: set
            .rotor_leakage_saturation
            .unwrap_or(family.rotor_leakage_saturation * per_ampere),
        skin_ratio: set.skin_ratio.unwrap_or(family.skin_ratio),
        skin_leakage: set.skin_leakage.unwrap_or(skin),
        slots: set.slots,
        bars: set.bars,
        stator_fixed: set.stator_fixed,
        stator_fixed_deg: set.stator_fixed_deg,
        loss: set.loss.unwrap_or(0.0),
    })
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
            stator_fixed: config.saliency.stator_fixed,
            stator_fixed_deg: config.saliency.stator_fixed_deg,
        },
        iron: iron(config),
        warming: WarmingSettings {
            rs: config.warming.r_s,
            rr: config.warming.r_r,
            time_constant: config.warming.time_constant_s,
        },
        dc_link: DcLinkSettings {
            ripple: config.dc_link.ripple,
            ripple_hz: config.dc_link.ripple_hz,
            capacitor: config.dc_link.capacitor_f,
            pulses: config.dc_link.pulses,
            mains_hz: config.dc_link.mains_hz,
            source: config.dc_link.source,
            precharge: config.dc_link.precharge,
            outage_at: config.dc_link.outage_at_s,
            outage: config.dc_link.outage_s,
            sag_at: config.dc_link.sag_at_s,
            sag: config.dc_link.sag_s,
            sag_v: config.dc_link.sag_v,
            sag_ramp: config.dc_link.sag_ramp_s,
            load: config.dc_link.load_w,
            chopper_v: config.dc_link.chopper_v.unwrap_or(0.0),
            chopper: config.dc_link.chopper,
        },
        inverter: InverterSettings {
            vdc: i.dc_link_v,
            dead_time_us: i.dead_time_s * 1e6,
            propagation_us: i.propagation_us,
            residual_v: i.residual_v.unwrap_or(1.64 * relative_voltage),
            switched: i.switched,
            extra_dead_time_us: i.extra_dead_time_s * 1e6,
            node_capacitance: i.node_capacitance_f,
            on_resistance: i.on_resistance,
            more_ohm: [0.0, i.more_ohm_b, i.more_ohm_c],
            more_dead_time_us: [0.0, i.more_dead_time_b_us, i.more_dead_time_c_us],
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
            cross_talk_a: s.cross_talk_a,
            cross_talk_b: s.cross_talk_b,
            lag_b_us: s.lag_b_us,
            cubic_error: s.cubic_error,
            drift_a: s.drift_a,
            drift_b: s.drift_b,
            both_zero_vectors: s.both_zero_vectors,
            dc_gain_error: s.dc_gain_error,
            dc_lag_us: s.dc_lag_us,
            dc_noise_v: s.dc_noise_v,
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
            static_torque: config.shaft.static_nm,
            once_torque: config.shaft.once_nm,
            stops: config.shaft.stops_turns * TAU,
            stop_stiffness: config.shaft.stop_stiffness,
            stop_damping: MechanicsSettings::default().stop_damping,
            load_inertia: config.shaft.load_inertia,
            stiffness: config.shaft.stiffness,
            damping: config.shaft.damping,
            load: match config.load.mode {
                LoadMode::Locked => Load::Locked,
                LoadMode::Free => Load::Free { torque: config.load.torque_nm.unwrap_or(0.0) },
                LoadMode::Speed => Load::Speed { speed: config.load.speed_rpm * TAU / 60.0 },
            },
        },
        ..PlantSettings::default()
    }
}

/// The phase that is interrupted, 0 to 2.
pub fn open_phase(config: &Config) -> Option<usize> {
    (config.inverter.open_phase as usize).checked_sub(1)
}
