//! Functions for the tests of the effects.

use drive_core::Compare;
use motor_plant::{
    Complex, InverterSettings, IronSettings, Load, MeasurementSettings, Plant, PlantSettings,
    phases,
};

use crate::duties::duties;

/// A PWM period, s.
pub const T: f64 = 1.0 / 6000.0;

/// Settings with linear iron, ideal inverter and sensors, and a locked shaft.
pub fn settings() -> PlantSettings {
    let mut settings = PlantSettings {
        iron: Some(IronSettings::LINEAR),
        inverter: InverterSettings::IDEAL,
        measurement: MeasurementSettings::IDEAL,
        ..PlantSettings::default()
    };
    settings.mechanics.load = Load::Locked;
    settings
}

/// Settings with the machine of the dissertation, this inverter, ideal sensors, and a locked shaft.
pub fn behind(inverter: InverterSettings) -> PlantSettings {
    PlantSettings { iron: None, inverter, ..settings() }
}

/// The plant with these settings.
pub fn plant(settings: &PlantSettings) -> Plant {
    Plant::new(settings, 7).expect("plant")
}

/// Duties that give the voltage `v`, V, at 311 V.
pub fn compare(v: Complex) -> Compare {
    duties(phases(v).map(|v| 0.5 + v / 311.0))
}

/// The plant after `seconds` of a constant voltage.
pub fn held(settings: &PlantSettings, v: Complex, seconds: f64) -> Plant {
    let mut plant = plant(settings);
    for _ in 0..(seconds / T) as u32 {
        plant.advance(&compare(v), T);
    }
    plant
}

/// Checks that a value is within a tolerance.
pub fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected} ± {tolerance}");
}
