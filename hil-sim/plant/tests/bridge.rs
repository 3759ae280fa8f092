//! The plant that the tests of the inverter share.

use drive_core::Compare;
use motor_plant::{
    Complex, InverterSettings, Load, MeasurementSettings, Plant, PlantSettings, phases,
};

pub const PERIOD: f64 = 1.0 / 6000.0;
pub const TOP: u16 = InverterSettings::IDEAL.timer_top;

/// With a locked shaft and an ideal measurement.
pub fn settings(inverter: InverterSettings) -> PlantSettings {
    let mut settings = PlantSettings { inverter, ..Default::default() };
    settings.mechanics.load = Load::Locked;
    settings.measurement = MeasurementSettings::IDEAL;
    settings
}

pub fn plant(settings: &PlantSettings) -> Plant {
    Plant::new(settings, 1).expect("settings of the test")
}

/// Duty cycles as compare values.
pub fn duties([a, b, c]: [f64; 3]) -> Compare {
    let compare = |duty: f64| (duty * f64::from(TOP)).round().clamp(0.0, f64::from(TOP)) as u16;
    Compare { a: compare(a), b: compare(b), c: compare(c), enabled: true }
}

/// Compare values for a line-to-neutral voltage, all legs about half the dc link.
pub fn voltage(v: Complex) -> Compare {
    duties(phases(v).map(|v| 0.5 + v / 311.0))
}
