//! The plant for the tests of the inverter.

use drive_core::Compare;
use motor_plant::{
    Complex, InverterSettings, Load, MeasurementSettings, Plant, PlantSettings, phases,
};

use crate::duties::duties;

pub const PERIOD: f64 = 1.0 / 6000.0;

/// Settings with a locked shaft and an ideal measurement.
pub fn settings(inverter: InverterSettings) -> PlantSettings {
    let mut settings = PlantSettings { inverter, ..Default::default() };
    settings.mechanics.load = Load::Locked;
    settings.measurement = MeasurementSettings::IDEAL;
    settings
}

pub fn plant(settings: &PlantSettings) -> Plant {
    Plant::new(settings, 1).expect("settings of the test")
}

/// Compare values for a line-to-neutral voltage, all legs about half the dc link.
pub fn voltage(v: Complex) -> Compare {
    duties(phases(v).map(|v| 0.5 + v / 311.0))
}
