//! Tests that settings with any nameplate in its range build, or are refused because of a key of the nameplate or because the time
//! constant of the leakage is too short.
#![allow(clippy::disallowed_methods)] // std functions are the reference here

use std::f32::consts::{SQRT_2, TAU};

use induction_drive_core::Motor;
use induction_drive_settings::{Flux, Nameplate, Settings, SettingsError};
use proptest::prelude::*;

/// Returns a value between `from` and `to`, at the share `at` of their distance on a logarithmic scale.
fn log(from: f32, to: f32, at: f32) -> f32 {
    from * (to / from).powf(at)
}

/// Returns settings for a motor with this nameplate. Its parameters, per unit, lie in the usual range of induction motors, each at a share
/// from 0 to 1. The dc link gives its rated voltage, and the sensors have `range` times its rated peak current.
fn settings(plate: Nameplate, pole_pairs: u8, at: [f32; 4], range: f32) -> Settings {
    let z = plate.voltage_v / (3_f32.sqrt() * plate.current_a);
    let l = z / (TAU * plate.frequency_hz);
    let motor = Motor {
        r_s: log(0.02, 0.1, at[0]) * z,
        r_r: log(0.015, 0.08, at[1]) * z,
        l_ls: log(0.05, 0.15, at[2]) * l,
        l_lr: log(0.05, 0.15, at[2]) * l,
        l_m: log(1.0, 4.0, at[3]) * l,
        pole_pairs,
    };
    let mut s = Settings { motor, nameplate: plate, ..Settings::default() };
    s.inverter.dc_link_v = SQRT_2 * plate.voltage_v;
    s.scales.dc_link.gain = 1.45 * s.inverter.dc_link_v / 4095.0;
    let end = (range * SQRT_2 * plate.current_a).min(5000.0);
    for line in [&mut s.scales.current_a, &mut s.scales.current_b, &mut s.scales.current_c] {
        (line.gain, line.offset) = (2.0 * end / 4095.0, -end);
    }
    s
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_nameplate_builds(
        volts in 0_f32..1.0, watts in 0_f32..1.0, hertz in 0_f32..1.0, slip in 0.005_f32..0.12,
        pole_pairs in 1_u8..=6, power_factor in 0.35_f32..0.75, at in prop::array::uniform4(0_f32..1.0),
        range in 1.0_f32..4.0,
    ) {
        let (voltage_v, power_w) = (log(24.0, 690.0, volts), log(50.0, 30_000.0, watts));
        let frequency_hz = log(25.0, 400.0, hertz);
        let speed_rpm = 60.0 * frequency_hz / f32::from(pole_pairs) * (1.0 - slip);
        let current_a = power_w / (3_f32.sqrt() * voltage_v * power_factor);
        let plate = Nameplate { power_w, voltage_v, current_a, frequency_hz, speed_rpm };
        let s = settings(plate, pole_pairs, at, range);
        // These are the settings before the motor is known, with the flux of a board that is to be commissioned.
        let mut unknown = Settings { motor: Motor::DEFAULT, ..s };
        unknown.sequence.flux = Flux::High;
        if let Err(error) = unknown.build().map(drop) {
            let by_plate = matches!(error, SettingsError::Range { name, .. } if name.starts_with("nameplate."));
            prop_assert!(by_plate, "motor unknown: {error}: {plate:?}, range {range}");
        }
        match s.build().map(drop) {
            Ok(()) => {}
            Err(SettingsError::Range { name, .. }) if name.starts_with("nameplate.") => {}
            Err(error) => {
                let periods = 6000.0 * (s.motor.l_ls + s.motor.l_lr) / (s.motor.r_s + s.motor.r_r);
                let named = matches!(&error, SettingsError::Tuning(e) if e.name.contains("too short"));
                prop_assert!(named && periods < 4.7, "{error}: {plate:?} {:?}, range {range}", s.motor);
            }
        }
    }
}
